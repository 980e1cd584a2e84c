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
#include "core/dataset/photo_file.h"
#include "core/formats/images.h"
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

struct PictureAnswer {
  PhotographHeader header;
  std::string bytes;
};

// Makes the JPEG or the pixels. DATA_LOSS: the file fails its digest. RESOURCE_EXHAUSTED: memory is
// not enough. Libraries throw bad_alloc then.
absl::StatusOr<PictureAnswer> MakeAnswer(const PhotographTask& task) {
  try {
    ASSIGN_OR_RETURN(const std::string bytes, ReadPhotographInput(task.name));
    if (Sha256Hex(bytes) != task.sha256) {
      return absl::DataLossError(absl::StrCat(task.name, ": the stored file fails its SHA-256"));
    }
    PhotographForm form = task.form;
    form.max_side = form.max_side > 0 ? std::min(form.max_side, kMaxJpegSide) : kMaxJpegSide;
    const std::span<const uint8_t> span(reinterpret_cast<const uint8_t*>(bytes.data()),
                                        bytes.size());
    ASSIGN_OR_RETURN(const Image image, FormPhotograph(span, task.name, form));
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
