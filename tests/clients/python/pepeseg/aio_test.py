"""Tests that the asyncio client does the same as the blocking one."""

import asyncio
import inspect
import os

import numpy as np
import pytest

import pepeseg
from conftest import Pepesegd
from pepeseg import aio

VIEW = "frame-000000.jpg"
POINT = [[440, 280]]
MIB = 1 << 20


def run(server, scene, use):
    async def body():
        async with aio.Client(scene, server=server.address) as client:
            return await use(client)

    return asyncio.run(body())


def test_both_clients_have_the_same_methods_and_arguments():
    blocking = {n: m for n, m in vars(pepeseg.Client).items() if not n.startswith("_")}
    awaited = {n: m for n, m in vars(aio.Client).items() if not n.startswith("_")}
    assert blocking.keys() == awaited.keys()
    for name, method in blocking.items():
        ours, theirs = inspect.signature(method), inspect.signature(awaited[name])
        assert list(ours.parameters.values()) == list(theirs.parameters.values()), name
        assert method.__doc__, name


def test_concurrent_calls_return_the_same_as_blocking_ones(server, trained, client):
    async def use(asked):
        scales = [0.1, 0.3, 0.5, 0.7]
        return await asyncio.gather(
            *(asked.segment(VIEW, points=POINT, scale=scale, threshold=0.3) for scale in scales)
        )

    answers = run(server, trained, use)
    for answer in answers:
        alike = client.segment(VIEW, points=POINT, scale=answer.scale, threshold=0.3)
        assert np.array_equal(alike.mask, answer.mask)


def test_a_selection_uses_its_client(server, trained, tmp_path):
    async def use(client):
        first = await client.select(VIEW, points=POINT, threshold=0)
        second = await first.combine("union", await client.select(VIEW, points=[280, 280]))
        assert (await second.undo()).name == first.name
        assert second.name in [selection.name for selection in await client.selections()]
        written = await first.export(tmp_path / "cup.ply")
        await second.delete()
        assert written.num_gaussians == first.num_gaussians
        return (tmp_path / "cup.ply").read_bytes()[:3]

    assert run(server, trained, use) == b"ply"


def test_uploads_and_watches(server, tmp_path):
    (tmp_path / "images").mkdir()
    for name in "ab":
        (tmp_path / "images" / f"{name}.jpg").write_bytes(os.urandom(2 * MIB + 5))
    told = []

    async def use(client):
        sealed = await client.upload(tmp_path, progress=lambda done, _: told.append(done))
        job = await client.start_training()
        events = [event async for event in client.watch(job)]
        with pytest.raises(pepeseg.JobFailedError):
            await client.wait(job)
        await client.delete_scene()
        return sealed, events

    sealed, events = run(server, "awaited", use)
    assert sealed.num_files == 2 and told[-1] == sealed.num_bytes
    assert events[0].HasField("snapshot") and events[-1].HasField("state_changed")


def test_errors_are_the_same(server, trained, tmp_path):
    async def use(client):
        with pytest.raises(pepeseg.InvalidArgumentError) as error:
            await client.segment(VIEW, points=POINT, threshold=7)
        assert error.value.field == "granularity.threshold"
        with pytest.raises(pepeseg.NotFoundError):
            await client.export(tmp_path / "none.ply", 999)
        with pytest.raises(pepeseg.NotFoundError):
            async for _ in client.watch("jobs/j999"):
                pass
        for name in "ab":
            (tmp_path / f"{name}.jpg").write_bytes(os.urandom(100))
        other = client.of("vanished-too")
        with pytest.raises(FileNotFoundError):
            await other.upload(tmp_path, progress=lambda *_: (tmp_path / "b.jpg").unlink())

    run(server, trained, use)


def test_a_cancelled_task_ends_its_call(server, trained):
    async def use(client):
        watch = client.watch(await client.start_training(steps=30000, image_scale=0.25), after=0)
        task = asyncio.ensure_future(client.wait((await anext(watch)).snapshot.name))
        await asyncio.sleep(0.5)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        await watch.aclose()
        job = (await client.jobs())[0]
        await client.cancel(job)
        with pytest.raises(pepeseg.JobCancelledError):
            await client.wait(job)

    run(server, trained, use)


def test_an_upload_resumes_after_kill_9(tmp_path):
    (tmp_path / "server").mkdir()
    (tmp_path / "large.jpg").write_bytes(os.urandom(8 * MIB))
    running = Pepesegd(tmp_path / "server")
    killed = []

    async def use(client):
        def kill_once(done, total):
            if done == 4 * MIB and not killed:
                killed.append(done)
                running.kill()
                running.start()

        return await client.upload(tmp_path, progress=kill_once)

    try:
        assert run(running, "large", use).num_bytes == 8 * MIB
        assert killed
    finally:
        running.stop()
