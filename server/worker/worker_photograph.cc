#include "server/worker/worker_photograph.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <new>
#include <span>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "core/dataset/view_warp.h"
#include "core/formats/decode_image.h"
#include "core/formats/encode_png.h"
#include "core/formats/exif.h"
#include "core/formats/heic.h"
#include "core/formats/heic_header.h"
#include "core/model_files/model_facts.h"
#include "server/worker/sandbox/worker_limits.h"
#include "server/worker/sandbox/worker_sandbox.h"
#include "server/worker_protocol/photograph_task.h"

namespace pepeseg {
namespace {

constexpr int kJpegQuality = 90;
// Maximum side of a JPEG, pixels. The format's limit is 65,535.
constexpr int kMaxJpegSide = 65'500;

absl::Status InputOutputError(absl::string_view what) {
  return absl::InternalError(absl::StrCat(what, ": ", std::generic_category().message(errno)));
}

// Reads all of standard input, which must be a regular file.
absl::StatusOr<std::string> ReadPhotographInput(const std::string& name) {
  struct stat facts {};
  if (fstat(STDIN_FILENO, &facts) != 0) return InputOutputError("fstat");
  // The size is checked before memory is taken for the bytes.
  if (!S_ISREG(facts.st_mode) || facts.st_size > kMaxImageFileBytes) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", facts.st_size,
                                                   " bytes exceed the limit of ",
                                                   kMaxImageFileBytes, " of an image file"));
  }
  std::string bytes(static_cast<size_t>(facts.st_size), '\0');
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t size = read(STDIN_FILENO, bytes.data() + at, bytes.size() - at);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return InputOutputError("read");
    if (size == 0) return absl::DataLossError(absl::StrCat(name, ": the stored file is cut short"));
    at += static_cast<size_t>(size);
  }
  return bytes;
}

absl::Status WritePhotographOutput(absl::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t size = write(STDOUT_FILENO, bytes.data(), bytes.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return InputOutputError("write");
    bytes.remove_prefix(static_cast<size_t>(size));
  }
  return absl::OkStatus();
}

// Warps a decoded photograph, whose file has an EXIF orientation, to the view of the task. The task
// has the view as the metadata of a model with this view alone.
absl::StatusOr<Image> WarpToView(const PhotographTask& task, Image image, int orientation) {
  Model model;
  RETURN_IF_ERROR(ParseModelFacts(task.view, model));
  if (model.views.size() != 1 || !model.views[0].photograph) {
    return absl::InternalError(absl::StrCat(task.name, ": the task names no view"));
  }
  const ModelView& view = model.views[0];
  const Lens& lens = view.photograph->lens;
  // The import records the file's orientation, or has turned the photograph upright (import.h).
  if (view.photograph->orientation != orientation) {
    Image upright = Upright(image, orientation);
    if (upright.width == lens.width && upright.height == lens.height) image = std::move(upright);
  }
  if (image.width != lens.width || image.height != lens.height) {
    return absl::InvalidArgumentError(absl::StrCat(
        task.name, ": ", image.width, "x", image.height, " pixels, the model's view is ",
        "of a photograph of ", lens.width, "x", lens.height));
  }
  return ViewWarp::Restore(*view.photograph, view.camera).Photo(image);
}

// Verifies the file's digest, decodes it, and turns or warps the image as the task says. DATA_LOSS:
// the digest differs.
absl::StatusOr<Image> DecodeInput(const PhotographTask& task, const std::string& bytes) {
  if (Sha256Hex(bytes) != task.sha256) {
    return absl::DataLossError(absl::StrCat(task.name, ": the stored file fails its SHA-256"));
  }
  const std::span<const uint8_t> span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  Image image;
  int orientation = 1;
  if (IsHeic(span)) {  // DecodeHeic turns it upright
    ASSIGN_OR_RETURN(HeicPhoto photo, DecodeHeic(span, task.name));
    image = std::move(photo.image);
  } else {
    ASSIGN_OR_RETURN(image, DecodePhoto(span, task.name));
    orientation = ReadExifOrientation(span);
  }
  if (!task.view.empty()) return WarpToView(task, std::move(image), orientation);
  if (task.upright) image = Upright(std::move(image), orientation);
  return image;
}

struct PictureAnswer {
  PhotographHeader header;
  std::string bytes;
};

// Makes the JPEG or the pixels. RESOURCE_EXHAUSTED: memory is not enough. Libraries throw bad_alloc
// then.
absl::StatusOr<PictureAnswer> MakeAnswer(const PhotographTask& task) {
  try {
    ASSIGN_OR_RETURN(const std::string bytes, ReadPhotographInput(task.name));
    ASSIGN_OR_RETURN(Image image, DecodeInput(task, bytes));
    const int max_side = task.max_side > 0 ? std::min(task.max_side, kMaxJpegSide) : kMaxJpegSide;
    image = ShrunkTo(std::move(image), max_side);
    std::string answer;
    if (task.raw) {
      answer.assign(image.pixels.begin(), image.pixels.end());
    } else {
      ASSIGN_OR_RETURN(answer, EncodeJpeg(image, kJpegQuality));
    }
    const auto size = static_cast<int64_t>(answer.size());
    return PictureAnswer{{absl::StatusCode::kOk, image.width, image.height, size},
                         std::move(answer)};
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat(task.name, ": decoding it takes more than ", MemoryLimit() >> 20, " MiB"));
  }
}

// Writes the JPEG or the pixels, or the error of making them. Returns an error if that cannot be
// written.
absl::Status WriteAnswer(const PhotographTask& task) {
  const absl::StatusOr<PictureAnswer> picture = MakeAnswer(task);
  if (picture.ok()) {
    RETURN_IF_ERROR(WritePhotographOutput(FormatPhotographHeader(picture->header)));
    return WritePhotographOutput(picture->bytes);
  }
  // The server limits what it reads of a message.
  const absl::string_view message =
      picture.status().message().substr(0, kMaxPhotographMessageBytes);
  const PhotographHeader header{picture.status().code(), 0, 0,
                                static_cast<int64_t>(message.size())};
  RETURN_IF_ERROR(WritePhotographOutput(FormatPhotographHeader(header)));
  return WritePhotographOutput(message);
}

}  // namespace

WorkerExit RunPhotographTask(const std::string& text, bool sandbox) {
  const absl::StatusOr<PhotographTask> task = ParsePhotographTask(text);
  if (!task.ok() || !LimitPhotograph().ok()) return WorkerExit::kBadSpec;
  YieldToServer();
  // No paths at all: input and output are open already. Nothing of the image has been read so far.
  if (sandbox && !EnterSandbox({}).ok()) return WorkerExit::kBadSpec;
  return WriteAnswer(*task).ok() ? WorkerExit::kSucceeded : WorkerExit::kFailed;
}

}  // namespace pepeseg
