#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/jobs/failed_photographs.h"
#include "server/worker_protocol/photograph_task.h"

namespace pepeseg {

// An open file; the destructor closes it.
class OpenFile {
 public:
  // Opens a file for reading. Refuses a symbolic link. Errors name it `name`. NOT_FOUND: there is
  // no such file.
  static absl::StatusOr<OpenFile> ForReading(const std::filesystem::path& path,
                                             const std::string& name);
  // Makes a file without a name on the file system of `folder`, which is created if it is missing.
  // The file disappears with the object, or with the process.
  static absl::StatusOr<OpenFile> Unnamed(const std::filesystem::path& folder);

  OpenFile(OpenFile&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  OpenFile& operator=(OpenFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~OpenFile();

  int descriptor() const { return descriptor_; }
  // Returns the size in bytes; negative: unknown.
  int64_t size() const;
  // Fills all of `bytes` from `offset` on. Returns false if the file ends before, or cannot be
  // read.
  bool ReadAt(int64_t offset, std::string& bytes) const;

 private:
  explicit OpenFile(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

// A JPEG or RGB values on disk, so that sending them to a slow client takes no memory.
struct PhotographPicture {
  OpenFile file;
  int64_t offset = 0;  // first byte of the image in the file
  int64_t num_bytes = 0;
  int width = 0, height = 0;  // pixels
};

// How to start the worker that decodes a photograph.
struct PhotographProcess {
  std::filesystem::path worker;  // the pepeseg-worker program
  bool sandbox = true;
  std::filesystem::path scratch;  // folder of the answer, an unnamed file
  absl::Duration time_limit = absl::Seconds(10);
  FailedPhotographs* failed = nullptr;  // null: failures are not remembered
};

// Starts a worker that decodes the image file `blob`, waits for it, and returns the picture that it
// made, as the task says. Blocks; polls `wanted` meanwhile.
// CANCELLED: `wanted` returned false, upon which the worker is killed.
// INVALID_ARGUMENT: the file does not decode, crashes the worker, or takes more than the time
// limit; remembered in `process.failed`, so that the next call does not start a worker. DATA_LOSS:
// the file fails its checksum. NOT_FOUND: there is no such file.
absl::StatusOr<PhotographPicture> MakePicture(const PhotographProcess& process,
                                              const PhotographTask& task,
                                              const std::filesystem::path& blob,
                                              absl::FunctionRef<bool()> wanted);

}  // namespace pepeseg
