"""Networks as the page is served them: events, numbers, and what there is not."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from pages import HERE, Page, served
from studies import write_nifti
from tomomesh import phantom
from tomomesh.view.networks.figures import FIGURES
from tomomesh.view.networks.trainers import REGIONS

if TYPE_CHECKING:
    from collections.abc import Iterator


HEAD = phantom((10, 48, 48), (5.0, 5.0, 14.0))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    path = tmp_path_factory.mktemp("study") / "head.nii"
    write_nifti(path, np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
    with served(path, "--lower", str(HEAD.lower), "--way", "ring") as found:
        found.enter()
        found.ready()
        yield found


def test_the_page_is_told_of_every_epoch_over_its_socket(page: Page) -> None:
    client = pytest.importorskip("websockets.sync.client")
    headers = {"Cookie": page.cookie}
    address = f"ws://{HERE}:{page.port}/api/events"
    page.state("/api/choose", {"epochs": 30, "trim": 0.0})
    with client.connect(address, origin=page.address.rstrip("/"), additional_headers=headers) as link:
        page.state("/api/train", {"slice": 4})
        told = [json.loads(link.recv(timeout=60))]
        while told[-1]["event"] not in ("done", "failed"):
            told.append(json.loads(link.recv(timeout=60)))
    epochs = [one["n"] for one in told if one["event"] == "epoch"]
    assert epochs == list(range(len(epochs)))
    assert len(epochs) == 1 + 30 + 1  # the start, the epochs, and the ring as it is handed on
    assert told[-1]["count"] == len(epochs)


def test_slices_and_inputs_are_handed_out_as_numbers(page: Page) -> None:
    page.state("/api/train", {"slice": 4})
    page.ready()
    status, headers, data = page.ask("/training/picture?k=4")
    drawn = np.frombuffer(data, np.uint8).reshape([int(n) for n in headers["x-shape"].split(",")])
    assert (status, headers["x-spacing"], headers["x-upward"]) == (200, "5.0,5.0", "0")
    plane = np.asarray(HEAD.volume.voxels[4])
    assert np.array_equal(drawn[1] > 0, (plane > HEAD.lower))
    order = np.argsort(plane.ravel(), kind="stable")
    assert (np.diff(drawn[0].ravel()[order].astype(int)) >= 0).all()
    assert page.ask("/training/picture?of=training")[2] == data
    told = page.state("/api/training")["training"]
    status, headers, data = page.ask("/training/inputs")
    assert headers["x-shape"] == f"{told['inputs']},2"
    assert np.isfinite(np.frombuffer(data, "<f4")).all()


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/training/picture?k=99", 404), ("/training/picture?k=x", 404), ("/training/picture", 404),
        ("/api/training/maps/0", 400), ("/api/training/maps/99999", 404), ("/api/networks/4", 400),
        ("/api/networks", 200), ("/picture/relief", 200), ("/picture/relief?k=3", 200), ("/training.gif", 200),
        ("/training.toml", 200),
    ],
)  # fmt: skip
def test_answers(page: Page, path: str, status: int) -> None:
    page.state("/api/choose", {"network": "ring"})
    page.state("/api/train", {"slice": 4})
    page.ready()
    assert page.ask(path)[0] == status


def test_nothing_else_is_trained() -> None:
    assert set(REGIONS) >= {one.region for one in FIGURES}
    assert replace(FIGURES[0], choices={}).told["choices"] == {}
