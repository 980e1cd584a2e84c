"""python -m pepeseg: the package on the command line."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from pepeseg import __version__, errors, exports, importers, png, training
from pepeseg.client import Client
from pepeseg.dataset import Dataset, read_folder

_EPILOG = """exit codes, the same as those of the client `pepeseg`:
  0 done               1 unexpected fault       2 wrong command line
  3 not found          4 value or file refused  5 no server answers
  6 not now: it exists, a training is running, or there is no model yet
  7 the job failed     8 the job was cancelled  9 a limit of the server
 10 not permitted     11 corrupt bytes        130 interrupted; a job goes on

`python -m pepeseg VERB --help` lists a verb's options. PEPESEG_SERVER, PEPESEG_KEY, PEPESEG_CA,
PEPESEG_CERTIFICATE and PEPESEG_CERTIFICATE_KEY are used for options that are not given."""

_EXIT_CODES: tuple[tuple[type[Exception], int], ...] = (
    (errors.JobFailedError, 7),
    (errors.JobCancelledError, 8),
    (errors.NotFoundError, 3),
    (FileNotFoundError, 3),
    (NotADirectoryError, 3),
    (errors.InvalidArgumentError, 4),
    (errors.OutOfRangeError, 4),
    (errors.UnavailableError, 5),
    (errors.DeadlineExceededError, 5),
    (errors.AlreadyExistsError, 6),
    (errors.FailedPreconditionError, 6),
    (errors.AbortedError, 6),
    (errors.ResourceExhaustedError, 9),
    (errors.UnauthenticatedError, 10),
    (errors.PermissionDeniedError, 10),
    (errors.DataLossError, 11),
    (OSError, 4),
)


def _numbers(count: int, what: str) -> type:
    """Returns a type for argparse: `count` numbers with commas between them."""

    class Numbers(list[float]):
        def __init__(self, text: str) -> None:
            super().__init__(float(part) for part in text.split(","))
            if len(self) != count:
                raise ValueError(text)

    Numbers.__name__ = what
    return Numbers


_POINT = _numbers(2, "X,Y")
_BOX = _numbers(4, "X,Y,WIDTH,HEIGHT")


def _read(arguments: argparse.Namespace) -> Dataset:
    if arguments.layout == "nerfstudio":
        return importers.nerfstudio(arguments.folder)
    if arguments.layout == "colmap":
        return importers.colmap(arguments.folder)
    return read_folder(arguments.folder, arguments.depth_kind)


def _upload(client: Client, arguments: argparse.Namespace) -> None:
    dataset = _read(arguments)
    for name in dataset.left_out[:10]:
        print(f"left out, no part of a dataset: {name}", file=sys.stderr)
    if len(dataset.left_out) > 10:
        print(f"... and {len(dataset.left_out) - 10} more", file=sys.stderr)
    sealed = client.upload(dataset, progress=True)
    print(f"{sealed.name}: {sealed.num_files} files, {sealed.num_bytes * 1e-6:.1f} MB")


def _train(client: Client, arguments: argparse.Namespace) -> None:
    options = dict(setting.partition("=")[::2] for setting in arguments.option)
    job = client.start_training(
        preset=arguments.preset,
        steps=arguments.steps,
        feature_steps=arguments.feature_steps,
        image_scale=arguments.image_scale,
        options=options,
        dataset=arguments.dataset,
    )
    if arguments.detach:
        print(job.name)
        return
    print(job.name, file=sys.stderr)
    _print_model(client, job.name)


def _print_model(client: Client, job: str) -> None:
    model = client.wait(job, progress=True)
    scores = [name for name in ("psnr", "ssim", "lpips") if name in model.metrics]
    metrics = "".join(f"  {name} {model.metrics[name]:.4g}" for name in scores)
    print(f"{model.name}: {model.num_gaussians} Gaussians{metrics}")


def _watch(client: Client, arguments: argparse.Namespace) -> None:
    _print_model(client, arguments.job)


def _cancel(client: Client, arguments: argparse.Namespace) -> None:
    print(f"{client.cancel(arguments.job).name}: told to stop")


def _scenes(client: Client, arguments: argparse.Namespace) -> None:
    for scene in client.scenes():
        print(f"{scene.id}  {scene.live_model or scene.active_job or 'no model yet'}")


def _views(client: Client, arguments: argparse.Namespace) -> None:
    for view in client.views():
        scores = f"  held out, {view.psnr:.2f} dB" if view.psnr is not None else ""
        print(f"{view.name}  {view.camera.width}x{view.camera.height}{scores}")


def _stem(view: str) -> str:
    """Returns a file name for a view. The view's name comes from the server and must not lead out
    of the output folder."""
    stem = str(Path(view).with_suffix("")).replace("/", "-")
    return stem if stem and not stem.startswith(".") else f"view{stem}"


def _segment(client: Client, arguments: argparse.Namespace) -> None:
    views = [view for value in arguments.views for view in value.split(",") if view]
    group = views[0] if views in (["all"], ["held-out"]) else None
    found = client.segment(
        arguments.view,
        points=arguments.point or None,
        negative=arguments.negative or None,
        box=arguments.box,
        label=arguments.label,
        scale=arguments.scale,
        threshold=arguments.threshold,
        targets=group or views or None,
    )
    print(f"{found.model}  scale {found.scale:.3f}  threshold {found.threshold:.3f}")
    if arguments.out is not None:
        arguments.out.mkdir(parents=True, exist_ok=True)
    for mask in found.masks:
        x, y, width, height = mask.box
        print(
            f"  {mask.view}  {mask.area} px  score {mask.score:.3f}  box {x},{y} {width}x{height}"
        )
        if arguments.out is not None:
            (arguments.out / f"{_stem(mask.view)}_mask.png").write_bytes(png.encode(mask.mask))


def _propose(client: Client, arguments: argparse.Namespace) -> None:
    for proposal in client.propose(arguments.view, points=arguments.point):
        print(
            f"{'*' if proposal.best else ' '} {proposal.kind:6}  scale {proposal.scale:.3f}  "
            f"threshold {proposal.threshold:.3f}  support {proposal.support:.3f}  "
            f"{proposal.area} px"
        )


def _select(client: Client, arguments: argparse.Namespace) -> None:
    selection = client.select(
        arguments.view,
        points=arguments.point,
        scale=arguments.scale,
        threshold=arguments.threshold,
    )
    print(f"{selection.name}: {selection.num_gaussians} Gaussians")
    if arguments.export is not None:
        written = selection.export(arguments.export)
        print(f"{written.path}: {written.num_bytes * 1e-6:.1f} MB")


def _export(client: Client, arguments: argparse.Namespace) -> None:
    written = client.export(
        arguments.file,
        arguments.selection,
        without=arguments.without,
        origin=arguments.origin,
        format=arguments.format,
    )
    print(f"{written.path}: {written.num_gaussians} Gaussians, {written.num_bytes * 1e-6:.1f} MB")


def _add_prompt(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("-p", "--point", type=_POINT, action="append", metavar="X,Y", default=[])
    verb.add_argument(
        "--scale", type=float, help="0: a small part, 1: the largest; by default chosen"
    )
    verb.add_argument("--threshold", type=float, help="cosine above which a pixel is in the mask")


def _add_training(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("--preset", choices=training.PRESETS, help="preview, standard, best or paper")
    verb.add_argument("--steps", type=int, help="steps of the reconstruction")
    verb.add_argument("--feature-steps", type=int, help="steps of the feature training")
    verb.add_argument("--image-scale", type=float, help="shrink the photographs by this, (0, 1]")
    verb.add_argument("--dataset", help="number of the dataset; the newest by default")
    verb.add_argument("-o", "--option", action="append", metavar="NAME=VALUE", default=[])
    verb.add_argument("--detach", action="store_true", help="print the job's name and exit")


def _add_verbs(parser: argparse.ArgumentParser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True)

    def add(name: str, do: object, text: str, scene: bool = True) -> argparse.ArgumentParser:
        verb = verbs.add_parser(name, help=text, description=text)
        if scene:
            verb.add_argument("scene", metavar="SCENE", help="id of the scene")
        verb.set_defaults(do=do)
        return verb

    add("scenes", _scenes, "list the scenes", scene=False)
    verb = add("upload", _upload, "upload photographs or a video, with poses, masks and depth")
    verb.add_argument("folder", metavar="FOLDER", type=Path)
    verb.add_argument("--layout", choices=("pepeseg", "nerfstudio", "colmap"), default="pepeseg")
    verb.add_argument("--depth-kind", choices=("depth", "disparity"), default="depth")
    _add_training(add("train", _train, "train a model of a scene"))
    for name, do, text in (
        ("watch", _watch, "follow a job to its end"),
        ("cancel", _cancel, "stop a job"),
    ):
        add(name, do, text, scene=False).add_argument("job", metavar="JOB")
    add("views", _views, "list the views of the model")
    verb = add("segment", _segment, "masks of what a click means, in any view")
    verb.add_argument("--view", help="the view of the points or the box")
    _add_prompt(verb)
    verb.add_argument("-n", "--negative", type=_POINT, action="append", metavar="X,Y", default=[])
    verb.add_argument("--box", type=_BOX, metavar="X,Y,WIDTH,HEIGHT")
    verb.add_argument("--label", help="id of a label, in place of a view and points")
    verb.add_argument(
        "--views",
        nargs="+",
        action="extend",
        default=[],
        help="views to segment: names, all or held-out; separated by spaces or commas, or the option "
        "repeated",
    )
    verb.add_argument("--out", type=Path, help="folder for STEM_mask.png")
    for name, do, text in (
        ("propose", _propose, "what a click may mean, smallest first; * marks the best"),
        ("select", _select, "select the Gaussians of what a click means"),
    ):
        verb = add(name, do, text)
        verb.add_argument("--view", required=True)
        _add_prompt(verb)
        if name == "select":
            verb.add_argument("--export", type=Path, metavar="PLY", help="also write it here")
    verb = add("export", _export, "fetch a model, or a subset of it, for splat viewers")
    verb.add_argument("file", metavar="FILE", type=Path)
    verb.add_argument("--selection", type=int, help="number of a selection: only its Gaussians")
    verb.add_argument("--without", action="store_true", help="all other Gaussians in their place")
    verb.add_argument(
        "--origin",
        choices=tuple(exports.ORIGINS),
        default="local",
        help="map coordinates as floats relative to FILE.origin.json, or as doubles of the world",
    )
    verb.add_argument("--format", choices=tuple(exports.FORMATS))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m pepeseg",
        description="Scenes from photographs, segments from clicks.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=__version__)
    parser.add_argument("--server", metavar="[https://]HOST:PORT")
    parser.add_argument("--model", default="live", metavar="NUMBER")
    parser.add_argument("--key-file", type=Path, metavar="FILE", help="holds an API key or a JWT")
    parser.add_argument("--tls", action="store_true")
    parser.add_argument(
        "--ca", type=Path, metavar="PEM", help="authorities that may sign the server's certificate"
    )
    parser.add_argument("--certificate", type=Path, metavar="PEM", help="this client's certificate")
    parser.add_argument("--certificate-key", type=Path, metavar="PEM")
    _add_verbs(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    """Runs the command line and returns the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        with Client(
            getattr(arguments, "scene", "none"),
            server=arguments.server,
            model=arguments.model,
            key_file=arguments.key_file,
            ca=arguments.ca,
            certificate=arguments.certificate,
            certificate_key=arguments.certificate_key,
            tls=arguments.tls,
        ) as client:
            arguments.do(client, arguments)
    except (errors.PepesegError, OSError) as error:
        print(f"pepeseg: {error}", file=sys.stderr)
        return next((code for kind, code in _EXIT_CODES if isinstance(error, kind)), 1)
    except KeyboardInterrupt:
        print("\ninterrupted; a job that runs goes on", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
