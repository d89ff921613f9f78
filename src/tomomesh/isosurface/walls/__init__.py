"""The walls between all labels of a label map as one net, of which each label's mesh is a part."""
