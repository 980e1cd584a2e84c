"""pepeseg: photographs of a scene to 3D Gaussians that one click segments.

`Client` blocks, `aio.Client` awaits; both call a pepeseg server by gRPC. Pixel coordinates are x to
the right and y down, with a pixel's centre at + 0.5. Masks are bool [height, width], points [n, 2].
"""

from pepeseg.annotation_files import AnnotationExport
from pepeseg import aio
from pepeseg.cameras import Camera, View
from pepeseg.client import Client, Selection
from pepeseg.corrections import CorrectedMask, Correction
from pepeseg.dataset import Dataset, DatasetFile, FileKind, read_folder
from pepeseg.edits import Edit
from pepeseg.enum_words import stage_name, term_name
from pepeseg.errors import (
    AbortedError,
    AlreadyExistsError,
    CancelledError,
    DataLossError,
    DeadlineExceededError,
    FailedPreconditionError,
    InternalError,
    InvalidArgumentError,
    JobCancelledError,
    JobFailedError,
    NotFoundError,
    OutOfRangeError,
    PepesegError,
    PermissionDeniedError,
    ResourceExhaustedError,
    UnauthenticatedError,
    UnavailableError,
    UnimplementedError,
)
from pepeseg.evaluation import (
    EntityScores,
    Evaluation,
    GroupScores,
    SamAgreement,
    SamMask,
    Scores,
)
from pepeseg.exports import Export, MeshExport
from pepeseg.finding import Appearance, Findings, Found
from pepeseg.labels import Label
from pepeseg.photographs import Photograph
from pepeseg.png import Picture
from pepeseg.prompts import Prompt
from pepeseg.scenes import Model, Scene
from pepeseg.segmentation import Proposal, Segmentation, Snapshot, ViewMask
from pepeseg.subsets import Decomposition, Level, Segment
from pepeseg.upload import SealedDataset

__version__ = "0.1.0"

__all__ = [
    "AbortedError",
    "AlreadyExistsError",
    "AnnotationExport",
    "Appearance",
    "Camera",
    "CancelledError",
    "Client",
    "CorrectedMask",
    "Correction",
    "DataLossError",
    "Dataset",
    "DatasetFile",
    "DeadlineExceededError",
    "Decomposition",
    "Edit",
    "EntityScores",
    "Evaluation",
    "Export",
    "FailedPreconditionError",
    "FileKind",
    "Findings",
    "Found",
    "GroupScores",
    "InternalError",
    "InvalidArgumentError",
    "JobCancelledError",
    "JobFailedError",
    "Label",
    "Level",
    "MeshExport",
    "Model",
    "NotFoundError",
    "OutOfRangeError",
    "PepesegError",
    "PermissionDeniedError",
    "Photograph",
    "Picture",
    "Prompt",
    "Proposal",
    "ResourceExhaustedError",
    "SamAgreement",
    "SamMask",
    "Scene",
    "Scores",
    "SealedDataset",
    "Segment",
    "Segmentation",
    "Selection",
    "Snapshot",
    "UnauthenticatedError",
    "UnavailableError",
    "UnimplementedError",
    "View",
    "ViewMask",
    "aio",
    "read_folder",
    "stage_name",
    "term_name",
]
