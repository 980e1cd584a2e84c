"""Tests uploads: which files are a dataset, what is sent, and resuming after the server is lost."""

import os
import struct
import threading

import pytest

import pepeseg
from conftest import SHELF, Pepesegd
from pepeseg import importers
from pepeseg.dataset import FileKind, kind_of, read_folder

MIB = 1 << 20


def put(root, *names):
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(os.fsencode(name))


class TestFolder:
    def test_kinds_follow_the_layout(self):
        assert kind_of("images/left/A.JPEG") is FileKind.IMAGE
        assert kind_of("images/walk.mov") is FileKind.VIDEO
        assert kind_of("videos/walk.MP4") is FileKind.VIDEO
        assert kind_of("sparse/0/cameras.bin") is FileKind.POSES
        assert kind_of("sparse/images.txt") is FileKind.POSES
        assert kind_of("sparse/0/points3D.bin") is FileKind.POINTS
        assert kind_of("transforms.json") is FileKind.POSES
        assert kind_of("poses_bounds.npy") is FileKind.POSES
        assert kind_of("more/transforms.json") is None
        assert kind_of("sparse_pc.ply") is FileKind.POINTS
        assert kind_of("masks/a.json") is FileKind.MASK
        assert kind_of("masks/a.npy") is FileKind.MASK
        assert kind_of("masks/a/0001.png") is FileKind.MASK
        assert kind_of("ignore_mask.png") is FileKind.IGNORE_MASK
        assert kind_of("ignore/a.png") is FileKind.IGNORE_MASK
        assert kind_of("depth/a.png") is FileKind.DEPTH
        assert kind_of("depth/a.pfm", FileKind.DISPARITY) is FileKind.DISPARITY
        assert kind_of("disparity/a.NPY") is FileKind.DISPARITY
        assert kind_of("gaussians.ply") is FileKind.GAUSSIANS

    def test_the_shelf(self):
        dataset = read_folder(SHELF)
        assert len(dataset.names(FileKind.IMAGE)) == 15
        assert len(dataset.names(FileKind.MASK)) == 15
        assert len(dataset.names(FileKind.DEPTH)) == 15
        assert "labels/frame-000000.png" in dataset.left_out

    def test_bare_photographs_and_a_video_are_taken(self, tmp_path):
        put(tmp_path, "a.jpg", "walk.mp4", "notes.txt")
        dataset = read_folder(tmp_path)
        assert [file.name for file in dataset.files] == ["images/a.jpg", "videos/walk.mp4"]
        assert dataset.left_out == ["notes.txt"]
        assert [f.name for f in read_folder(tmp_path / "walk.mp4").files] == ["videos/walk.mp4"]

    def test_folders_without_photographs_are_refused(self, tmp_path):
        put(tmp_path, "notes.txt")
        with pytest.raises(pepeseg.InvalidArgumentError, match="no photographs"):
            read_folder(tmp_path)
        with pytest.raises(LookupError, match="no such folder"):
            read_folder(tmp_path / "nothing")


def frames(*names):
    listed = ", ".join(f'{{"file_path": "{name}", "transform_matrix": []}}' for name in names)
    return f'{{"ply_file_path": "sparse_pc.ply", "frames": [{listed}]}}'


class TestNerfstudio:
    def test_takes_frames_points_and_files_next_to_them(self, tmp_path):
        put(tmp_path, "images/a.png", "images/b.png", "images/c.png", "train/r_0.png")
        put(tmp_path, "sparse_pc.ply", "masks/a.json", "images_2/a.png")
        (tmp_path / "transforms.json").write_text(
            frames("./images/a.png", "images/b.png", "train/r_0", "images/gone.png")
        )
        dataset = importers.nerfstudio(tmp_path)
        kinds = {file.name: file.kind for file in dataset.files}
        assert kinds == {
            "images/a.png": FileKind.IMAGE,
            "images/b.png": FileKind.IMAGE,
            "images/train/r_0.png": FileKind.IMAGE,
            "transforms.json": FileKind.POSES,
            "sparse_pc.ply": FileKind.POINTS,
            "masks/a.json": FileKind.MASK,
        }
        assert dataset.missing == ["images/gone.png"]
        assert dataset.left_out == ["images/c.png", "images_2/a.png"]

    def test_depth_maps_are_named_after_their_photographs(self, tmp_path):
        put(tmp_path, "images/a.jpg", "d/7.png")
        (tmp_path / "transforms.json").write_text(
            '{"frames": [{"file_path": "images/a.jpg", "depth_file_path": "d/7.png"}]}'
        )
        depth = [f for f in importers.nerfstudio(tmp_path).files if f.kind is FileKind.DEPTH]
        assert [(f.name, f.path) for f in depth] == [("depth/a.png", tmp_path / "d/7.png")]

    @pytest.mark.parametrize("text", ["", "[]", '{"frames": 1}', '{"frames": [{}]}'])
    def test_a_broken_file_is_refused(self, tmp_path, text):
        (tmp_path / "transforms.json").write_text(text)
        with pytest.raises(pepeseg.InvalidArgumentError, match="transforms.json"):
            importers.nerfstudio(tmp_path)

    def test_missing_photographs_are_refused_and_one_is_named(self, tmp_path):
        (tmp_path / "transforms.json").write_text(frames("images/gone.png"))
        with pytest.raises(pepeseg.NotFoundError, match="images/gone.png"):
            importers.nerfstudio(tmp_path)
        with pytest.raises(pepeseg.NotFoundError, match="no transforms.json"):
            importers.nerfstudio(tmp_path / "images")


def images_bin(*names):
    data = struct.pack("<Q", len(names))
    for i, name in enumerate(names):
        data += struct.pack("<I7dI", i + 1, 1, 0, 0, 0, 0, 0, 0, 1) + name.encode() + b"\0"
        data += struct.pack("<Q", 2) + bytes(48)
    return data


class TestColmap:
    def test_takes_photographs_with_a_pose(self, tmp_path):
        put(tmp_path, "images/a.jpg", "images/left/b.jpg", "images/c.jpg", "masks/a.json")
        put(tmp_path, "sparse/0/cameras.bin", "sparse/0/points3D.bin", "sparse/0/project.ini")
        (tmp_path / "sparse/0/images.bin").write_bytes(images_bin("a.jpg", "left/b.jpg", "d.jpg"))
        dataset = importers.colmap(tmp_path)
        assert dataset.names(FileKind.IMAGE) == ["images/a.jpg", "images/left/b.jpg"]
        assert dataset.names(FileKind.POSES) == ["sparse/0/cameras.bin", "sparse/0/images.bin"]
        assert dataset.names(FileKind.POINTS) == ["sparse/0/points3D.bin"]
        assert dataset.names(FileKind.MASK) == ["masks/a.json"]
        assert dataset.missing == ["d.jpg"]
        assert dataset.left_out == ["images/c.jpg", "sparse/0/project.ini"]

    def test_reads_text_models_and_photographs_elsewhere(self, tmp_path):
        put(tmp_path, "model/cameras.txt", "photos/a b.jpg", "photos/c.jpg")
        (tmp_path / "model/images.txt").write_text(
            "# Image list\n1 1 0 0 0 0 0 0 1 a b.jpg\n\n2 1 0 0 0 0 0 0 1 c.jpg\n1 2 -1\n"
        )
        dataset = importers.colmap(tmp_path / "model", tmp_path / "photos")
        assert dataset.names(FileKind.IMAGE) == ["images/a b.jpg", "images/c.jpg"]
        assert dataset.names(FileKind.POSES) == ["sparse/0/cameras.txt", "sparse/0/images.txt"]
        assert dataset.missing == []

    def test_the_shelf(self):
        dataset = importers.colmap(SHELF)
        assert len(dataset.names(FileKind.IMAGE)) == 15 and not dataset.missing
        assert len(dataset.names(FileKind.DEPTH)) == 15

    @pytest.mark.parametrize("cut", [4, 40, 80])
    def test_a_model_cut_short_is_refused(self, tmp_path, cut):
        put(tmp_path, "sparse/cameras.bin", "images/a.jpg")
        (tmp_path / "sparse/images.bin").write_bytes(images_bin("a.jpg")[:cut])
        with pytest.raises(pepeseg.InvalidArgumentError, match="images.bin"):
            importers.colmap(tmp_path)


class TestUpload:
    def test_what_the_server_has_is_not_sent_again(self, server, tmp_path):
        put(tmp_path, "images/a.jpg", "images/b.jpg")
        with pepeseg.Client("twice", server=server.address) as client:
            told = []
            first = client.upload(tmp_path, progress=lambda done, total: told.append((done, total)))
            assert (first.name, first.num_files) == ("scenes/twice/datasets/1", 2)
            assert told[-1] == (first.num_bytes, first.num_bytes)
            told.clear()
            assert client.upload(tmp_path).name == "scenes/twice/datasets/2"
            assert told == []
            client.delete_scene()

    def test_datasets_are_listed_and_sealed_ones_stay(self, server, tmp_path):
        put(tmp_path, "images/a.jpg")
        with pepeseg.Client("kept", server=server.address) as client:
            sealed = client.upload(tmp_path)
            assert client.dataset(1) == sealed
            assert client.datasets() == [sealed]
            with pytest.raises(pepeseg.NotFoundError):
                client.dataset(2)
            with pytest.raises(pepeseg.FailedPreconditionError):
                client.delete_upload(1)
            client.delete_scene()

    def test_warns_of_missing_photographs(self, server, tmp_path):
        put(tmp_path, "images/a.png")
        (tmp_path / "transforms.json").write_text(frames("images/a.png", "images/gone.png"))
        with pepeseg.Client("gaps", server=server.address) as client:
            with pytest.warns(UserWarning, match="images/gone.png"):
                client.upload(importers.nerfstudio(tmp_path))
            client.delete_scene()

    def test_warns_of_missing_masks(self, server, tmp_path):
        put(tmp_path, "images/a.png")
        with pepeseg.Client("maskless", server=server.address) as client:
            with pytest.warns(UserWarning, match="pepeseg-priors"):
                dataset = client.upload(tmp_path)
            assert len(dataset.advice) == 1
            client.delete_scene()

    def test_a_file_that_cannot_be_read_is_an_os_error(self, server, tmp_path):
        put(tmp_path, "images/a.jpg")
        dataset = read_folder(tmp_path)
        (tmp_path / "images/a.jpg").unlink()
        with pepeseg.Client("gone", server=server.address) as client:
            with pytest.raises(FileNotFoundError):
                client.upload(dataset)

    def test_a_file_that_vanishes_while_it_is_sent_is_an_os_error(self, server, tmp_path):
        for name in "ab":
            (tmp_path / f"{name}.jpg").write_bytes(os.urandom(100))
        with pepeseg.Client("vanished", server=server.address) as client:
            with pytest.raises(FileNotFoundError):
                client.upload(tmp_path, progress=lambda *_: (tmp_path / "b.jpg").unlink())

    def test_bytes_that_change_during_an_upload_are_data_loss(self, server, tmp_path):
        put(tmp_path, "images/a.jpg")
        (tmp_path / "images/b.jpg").write_bytes(os.urandom(3 * MIB))

        def change(done, total):
            with open(tmp_path / "images/b.jpg", "r+b") as file:
                file.seek(-1, os.SEEK_END)
                file.write(bytes([file_end ^ 1]))

        file_end = (tmp_path / "images/b.jpg").read_bytes()[-1]
        with pepeseg.Client("changed", server=server.address) as client:
            with pytest.raises(pepeseg.DataLossError, match="images/b.jpg"):
                client.upload(tmp_path, progress=change)
            client.delete_upload(1)
            with pytest.raises(pepeseg.NotFoundError):
                client.delete_upload(1)
            client.delete_scene()

    def test_resumes_at_the_last_committed_byte_after_kill_9(self, tmp_path):
        (tmp_path / "server").mkdir()
        size = 64 * MIB
        (tmp_path / "photos").mkdir()
        (tmp_path / "photos" / "large.jpg").write_bytes(os.urandom(size))
        running = Pepesegd(tmp_path / "server")
        told = []

        def kill_once(done, total):
            told.append(done)
            if done == 62 * MIB and told.count(done) == 1:
                running.kill()
                threading.Timer(0.5, running.start).start()

        try:
            with pepeseg.Client("large", server=running.address) as client:
                sealed = client.upload(tmp_path / "photos", progress=kill_once)
            assert sealed.num_bytes == size
        finally:
            running.stop()
        # Progress counts bytes that were read to be sent; after the break it falls back to committed bytes.
        resumed = next(b for a, b in zip(told, told[1:]) if b < a)
        assert resumed == 33 * MIB
        assert told[-1] == size

    def test_masks_and_points_keep_the_names_that_frames_give_them(self, tmp_path):
        put(tmp_path, "images/a.png", "use/a.png", "pcd/fused.ply", "images/._a.png")
        (tmp_path / "transforms.json").write_text(
            '{"ply_file_path": "./pcd/fused.ply",'
            ' "frames": [{"file_path": "images/a.png", "mask_path": "use/a.png"}]}'
        )
        for dataset in (importers.nerfstudio(tmp_path), read_folder(tmp_path)):
            kinds = {file.name: file.kind for file in dataset.files}
            assert kinds["use/a.png"] is FileKind.MASK
            assert kinds["pcd/fused.ply"] is FileKind.POINTS
            assert len(kinds) == 4 and dataset.left_out == []

    def test_masks_may_lie_among_photographs_and_be_written_in_other_letters(self, tmp_path):
        put(tmp_path, "images/a.png", "images/a_mask.png", "Keep/b.png")
        (tmp_path / "transforms.json").write_text(
            '{"frames": [{"file_path": "images/a.png", "mask_path": "images/a_mask.png"},'
            ' {"file_path": "images/b.png", "mask_path": "keep/B.png"}]}'
        )
        dataset = read_folder(tmp_path)
        kinds = {file.name: file.kind for file in dataset.files}
        assert kinds["images/a.png"] is FileKind.IMAGE
        assert kinds["images/a_mask.png"] is FileKind.MASK
        assert kinds["Keep/b.png"] is FileKind.MASK and dataset.left_out == []


class TestWhatPeopleBring:
    def test_files_of_systems_and_live_photos_are_left_out(self, tmp_path):
        put(tmp_path, "IMG_1.HEIC", "IMG_1.MOV", "walk.mp4", "._IMG_1.HEIC", "Thumbs.db")
        put(tmp_path, "__MACOSX/IMG_1.HEIC")
        dataset = read_folder(tmp_path)
        assert [file.name for file in dataset.files] == ["images/IMG_1.HEIC", "videos/walk.mp4"]
        assert dataset.left_out == ["videos/IMG_1.MOV"]

    def test_folders_may_have_other_letters_and_be_inside_another(self, tmp_path):
        put(tmp_path, "garden/Images/a.jpg", "garden/sparse/1/cameras.bin", ".DS_Store")
        names = [file.name for file in read_folder(tmp_path).files]
        assert names == ["images/a.jpg", "sparse/1/cameras.bin"]

    def test_the_error_says_where_photographs_were_seen(self, tmp_path):
        put(tmp_path, "readme.txt", "day 1/a.jpg")
        with pytest.raises(pepeseg.InvalidArgumentError, match="there are some in day 1/"):
            read_folder(tmp_path)

    def test_names_that_are_not_utf8_are_refused_by_name(self, tmp_path):
        put(tmp_path, os.fsdecode(b"images/caf\xe9.jpg"))
        with pytest.raises(pepeseg.InvalidArgumentError, match="caf.*is not UTF-8; rename"):
            read_folder(tmp_path)

    def test_images_txt_may_lack_the_lines_of_points(self, tmp_path):
        put(tmp_path, "images/a.jpg", "images/b.jpg")
        (tmp_path / "sparse/0").mkdir(parents=True)
        (tmp_path / "sparse/0/cameras.txt").write_text("")
        (tmp_path / "sparse/0/images.txt").write_text(
            "1 1 0 0 0 0 0 0 1 a.jpg\n2 1 0 0 0 0 0 0 1 b.jpg\n1 2 -1\n"
        )
        names = [file.name for file in importers.colmap(tmp_path).files]
        assert names[:2] == ["images/a.jpg", "images/b.jpg"]
