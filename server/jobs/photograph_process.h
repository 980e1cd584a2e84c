#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/worker_protocol/photograph_task.h"

namespace pepeseg {

// An open file, closed with the object.
class OpenFile {
 public:
  // For reading; not through a link. `name` stands for it in errors. NOT_FOUND: there is none.
  static absl::StatusOr<OpenFile> ForReading(const std::filesystem::path& path,
                                             const std::string& name);
  // A new file without a name, on the file system of `folder`, which is made when it is not there:
  // it goes with the object, or with the process.
  static absl::StatusOr<OpenFile> Unnamed(const std::filesystem::path& folder);

  OpenFile(OpenFile&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  OpenFile& operator=(OpenFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~OpenFile();

  int descriptor() const { return descriptor_; }
  // Bytes; under 0: it cannot be told.
  int64_t size() const;
  // Fills `bytes` with what begins at `offset`. False: the file ends before, or cannot be read.
  bool ReadAt(int64_t offset, std::string& bytes) const;

 private:
  explicit OpenFile(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

// A JPEG on the disk, so that a slow reader of it costs no memory.
struct PhotographPicture {
  OpenFile file;
  int64_t offset = 0;  // of the JPEG in the file
  int64_t num_bytes = 0;
  int width = 0, height = 0;  // pixels
};

struct PhotographProcess {
  std::filesystem::path worker;  // the pepeseg-worker program
  bool sandbox = true;
  std::filesystem::path scratch;  // folder for the answer, which leaves nothing there
  absl::Duration time_limit = absl::Minutes(1);
};

// Has a worker of its own decode the image file `blob`, and waits for it. The worker is killed as
// soon as `wanted` says no (CANCELLED) and after the time limit (INVALID_ARGUMENT: what takes that
// long cannot be decoded; so is what kills the worker). Otherwise the worker's error: DATA_LOSS for
// a file that fails its checksum, INVALID_ARGUMENT for one that does not decode. NOT_FOUND: there
// is no such file.
absl::StatusOr<PhotographPicture> MakePicture(const PhotographProcess& process,
                                              const PhotographTask& task,
                                              const std::filesystem::path& blob,
                                              absl::FunctionRef<bool()> wanted);

}  // namespace pepeseg
