"""Names of labels from the tables that programs write."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from studies import write_nifti
from tomomesh import io
from tomomesh.cli import main

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture

TABLES = {
    "bids.tsv": "index\tname\tcolor\n2\tleft lobe\t#ff0000\n14175\twm_rh\t#00ff00\n",
    "excel.csv": "Name;Label\nleft lobe;2.0\nwm_rh;14175\n",
    "plain.csv": "2,left lobe\n14175,wm_rh\n",
    "slicer.csv": "LabelValue,Name,Color_R,Color_G,Color_B,Color_A\n2,left lobe,1,2,3,255\n14175,wm_rh,1,2,3,255\n",
    "total.json": '{"2": "left lobe", "14175": "wm_rh"}',
    "dataset.json": '{"labels": {"left lobe": 2, "wm_rh": 14175}, "channel_names": {"0": "CT"}}',
    "snap.label": '# ITK-SNAP\n    2   255 0 0   1  1  1    "left lobe"\n14175 0 255 0 0.5 1 0 "wm_rh"\n',
    "snap.txt": '2 255 0 0 1 1 1 "left lobe"\n14175 0 255 0 1 1 1 "wm_rh"\n',
}
PLAIN = {
    "FreeSurferColorLUT.txt": "#No. Label Name: R G B A\n\n2   left_lobe   245 245 245 0\n14175 wm_rh 1 2 3 0\n",
    "slicer.ctbl": "# Color table file\n2 left_lobe 245 245 245 255\n14175 wm_rh 1 2 3 255\n",
    "two.lut": "2 left_lobe\n14175 wm_rh\n",
}
WRONG = {
    "a.csv": "color,size\nred,3\n",
    "b.csv": "index,name\nx,liver\n",
    "c.json": "[1, 2]",
    "d.json": '{"1": {"name": "liver"}}',
    "e.txt": "1 liver and more\n",
    "f.txt": "<?xml version='1.0'?>\n",
    "g.tsv": "index\tname\n3\n",
    "h.csv": "",
    "i.csv": "index,name\n",
    "j.csv": "index,name\n3,a\n3,b\n",
    "k.json": "{",
    "l.txt": "\udcff\udcfe\udcfa",
}


class TestTables:
    @pytest.mark.parametrize("name", TABLES | PLAIN)
    def test_names_are_those_that_programs_write(self, name: str, tmp_path: Path) -> None:
        (tmp_path / name).write_text((TABLES | PLAIN)[name])
        first = "left lobe" if name in TABLES else "left_lobe"
        assert io.read_label_names(tmp_path / name) == {2: first, 14175: "wm_rh"}

    @pytest.mark.parametrize("name", WRONG)
    def test_what_is_no_table_is_refused_in_one_line(
        self, name: str, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        (tmp_path / name).write_bytes(WRONG[name].encode("utf-8", "surrogateescape"))
        labels = write_nifti(tmp_path / "labels.nii", np.ones((4, 4, 4), np.uint8), np.eye(4))
        line = ["reconstruct", str(labels), "--each-label", "-o", str(tmp_path / "out")]
        assert main([*line, "--label-names", str(tmp_path / name)]) == 4
        said, *more = capsys.readouterr().err.splitlines()
        assert name in said
        assert not more
        assert not (tmp_path / "out").exists()

    def test_numbers_in_any_order_come_to_the_same(self, tmp_path: Path) -> None:
        rows = [f"{n},organ {n}" for n in range(1, 40)]
        for order in (rows, rows[::-1]):
            (tmp_path / "n.csv").write_text("\n".join(["id,structure", *order]))
            assert io.read_label_names(tmp_path / "n.csv") == {n: f"organ {n}" for n in range(1, 40)}
