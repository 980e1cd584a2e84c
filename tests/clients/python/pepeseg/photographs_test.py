"""Tests fetching photographs."""

import hashlib
import io

import pytest
from PIL import Image

import pepeseg
from conftest import SHELF

NAME = "frame-000000.jpg"


@pytest.fixture(scope="module")
def client(server):
    """A client of a scene with a dataset and no model."""
    with pepeseg.Client("photographs", server=server.address) as connected:
        connected.upload(SHELF)
        yield connected


def test_an_original_has_the_bytes_of_the_upload(client):
    original = client.photograph(NAME, dataset=1, original=True)
    uploaded = (SHELF / "images" / NAME).read_bytes()
    assert hashlib.sha256(original.data).digest() == hashlib.sha256(uploaded).digest()
    assert original.content_type == "image/jpeg"


def test_a_thumbnail_has_the_requested_size(client):
    small = client.photograph("", dataset=1, max_side=64)
    assert (small.width, small.height) == (64, 48)
    assert Image.open(io.BytesIO(small.data)).size == (64, 48)


def test_arguments_that_exclude_each_other_are_refused_before_sending(client):
    with pytest.raises(pepeseg.InvalidArgumentError, match="frame"):
        client.photograph(NAME, frame="sideways")
    with pytest.raises(pepeseg.InvalidArgumentError, match="original"):
        client.photograph(NAME, original=True, max_side=10)


def test_errors_of_the_server_are_raised(client):
    with pytest.raises(pepeseg.NotFoundError, match="no such photograph"):
        client.photograph("none.jpg", dataset=1)
    with pytest.raises(pepeseg.FailedPreconditionError):
        client.photograph(NAME)  # there is no model
    with pytest.raises(pepeseg.InvalidArgumentError, match="a dataset has no views"):
        client.photograph(NAME, dataset=1, frame="view")
