"""What both clients share: the scene that they are for, and operations as methods."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
import functools
import inspect
import os
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

from pepeseg.calls import Place, Steps
from pepeseg.channel import Connection, Login, look_through
from pepeseg.nearest import with_nearest_names
from pepeseg.prompts import Prompt

P = ParamSpec("P")
File = TypeVar("File")
T = TypeVar("T")
Self = TypeVar("Self", bound="SceneClient")


def _place_of(scene: str, model: str | int) -> Place:
    """Returns the names for a scene's id or name and a model's number or name."""
    name = scene if scene.startswith("scenes/") else f"scenes/{scene}"
    return Place(name, str(model) if "/" in str(model) else f"{name}/models/{model}")


class SceneClient(ABC):
    """A connection, and the scene and model that calls are about."""

    def __init__(
        self,
        scene: str,
        *,
        server: str | None = None,
        model: str | int = "live",
        key: str | None = None,
        key_file: str | os.PathLike[str] | None = None,
        ca: str | os.PathLike[str] | None = None,
        certificate: str | os.PathLike[str] | None = None,
        certificate_key: str | os.PathLike[str] | None = None,
        tls: bool = False,
        patience: float = 5.0,
    ) -> None:
        """Connects with the first call.

        Args:
            scene: id of the scene: 1 to 63 of a-z, A-Z, 0-9, '_', '.' and '-', beginning with a
                letter or a digit.
            model: number of the model; "live" is the live one. "jobs/j3" is the model of a job, also
                while the job trains it: segment, propose, decompose and render answer by its newest
                snapshot.
            server: "[https://]host:port", "http://host:port" or "unix:path"; else
                PEPESEG_SERVER, else 127.0.0.1:50051.
            key: an API key ("pk_...") or a JWT; else the first line of `key_file`, else
                PEPESEG_KEY.
            ca: PEM file of the authorities that may sign the server's certificate; else PEPESEG_CA,
                else those that the system trusts.
            certificate, certificate_key: PEM files of this client; else PEPESEG_CERTIFICATE and
                PEPESEG_CERTIFICATE_KEY.
            tls: encrypt; also implied by https://, `ca` and `certificate`.
            patience: seconds for which a refused call is repeated; 0: it is not repeated.

        Raises:
            InvalidArgumentError: a file cannot be read, or the key would go to another machine
                unencrypted.
        """
        login = Login(server, key, key_file, ca, certificate, certificate_key, tls)
        self._place = _place_of(scene, model)
        self._open(look_through(login), patience)

    @abstractmethod
    def _open(self, connection: Connection, patience: float) -> None:
        ...

    @property
    def place(self) -> Place:
        """The names of the scene and the model that calls are about."""
        return self._place

    def of(self: Self, scene: str, model: str | int = "live") -> Self:
        """Returns a client for another scene or model, over the same connection."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._place = _place_of(scene, model)
        return other


class Runs(Protocol):
    """The blocking client, as operations need it."""

    @property
    def place(self) -> Place:
        ...

    def run(self, steps: Steps[T]) -> T:
        ...


class RunsAsync(Protocol):
    """The asyncio client, as operations need it."""

    @property
    def place(self) -> Place:
        ...

    async def run(self, steps: Steps[T]) -> T:
        ...


def _told_as(method: Any, operation: Callable[..., Any]) -> None:
    """Gives `method` the operation's name, docstring and signature, with `self` for its place."""
    functools.update_wrapper(method, operation)
    del method.__wrapped__
    signature = inspect.signature(operation)
    parameters = list(signature.parameters.values())
    parameters[0] = parameters[0].replace(name="self", annotation=inspect.Parameter.empty)
    if parameters[-1].kind is inspect.Parameter.VAR_KEYWORD:
        # The fields of the prompt, which operations take as keywords.
        fields = list(inspect.signature(Prompt).parameters.values())[1:]
        parameters[-1:] = [field.replace(kind=inspect.Parameter.KEYWORD_ONLY) for field in fields]
    answer = signature.return_annotation.removeprefix("Steps[").removesuffix("]")
    method.__signature__ = signature.replace(parameters=parameters, return_annotation=answer)


def blocking(
    operation: Callable[Concatenate[Place, P], Steps[T]]
) -> Callable[Concatenate[Runs, P], T]:
    """Makes an operation a method of the blocking client."""

    def method(self: Runs, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return self.run(with_nearest_names(self.place, operation(self.place, *args, **kwargs)))

    _told_as(method, operation)
    return method


def awaited(
    operation: Callable[Concatenate[Place, P], Steps[T]]
) -> Callable[Concatenate[RunsAsync, P], Awaitable[T]]:
    """Makes an operation a method of the asyncio client."""

    async def method(self: RunsAsync, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return await self.run(
            with_nearest_names(self.place, operation(self.place, *args, **kwargs))
        )

    _told_as(method, operation)
    return method


def of_itself(
    method: Callable[Concatenate[Any, File, Any, P], T]
) -> Callable[Concatenate[Any, File, P], T]:
    """Makes a client's method that writes a file of a subset a method of the client's selections."""

    def bound(self: Any, path: File, *args: P.args, **kwargs: P.kwargs) -> T:
        return method(self._client, path, self, *args, **kwargs)

    described: Any = functools.update_wrapper(bound, method)
    described.__doc__ = f"As `Client.{described.__name__}`, of this selection."
    signature = inspect.signature(method)
    parameters = list(signature.parameters.values())
    described.__signature__ = signature.replace(parameters=parameters[:2] + parameters[3:])
    return bound
