#include "server/observe/health_probes.h"

#include <unistd.h>

#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "server/observe/process_use.h"

namespace pepeseg {

absl::Status ProbeDisk(const std::filesystem::path& folder, int64_t min_free_bytes) {
  // Servers that share the folder must not meet.
  const std::filesystem::path file = folder / absl::StrCat(".health-", getpid());
  RETURN_IF_ERROR(WriteFileAtomically(file, "written by the health probe\n"));
  std::error_code error;
  std::filesystem::remove(file, error);
  if (error) {
    return absl::InternalError(absl::StrCat(file.string(), ": cannot remove: ", error.message()));
  }
  const int64_t free = DiskFreeBytes(folder);
  if (free < 0) return absl::InternalError(folder.string() + ": cannot tell how much is free");
  if (free > min_free_bytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(folder.string(), ": ", free,
                                                   " bytes are free, must be over ", min_free_bytes,
                                                   ": uploads and trainings need room"));
}

absl::Status ProbeDevice(const Backend& backend) {
  // One that is not fatal is taken by the question that caused it.
  constexpr absl::Duration kPause = absl::Milliseconds(100);
  std::string error = backend.error();
  for (int i = 0; i < 3 && !error.empty(); ++i) {
    absl::SleepFor(kPause);
    error = backend.error();
  }
  return error.empty() ? absl::OkStatus() : absl::InternalError(error);
}

}  // namespace pepeseg
