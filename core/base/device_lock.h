#pragma once

#include <mutex>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns and clears the first error of a backend since the last call (Backend::TakeError).
// RESOURCE_EXHAUSTED: an allocation failed; the backend remains usable. INTERNAL: the error is
// fatal for the backend.
inline absl::Status TakeStatus(Backend& backend) {
  const BackendError error = backend.TakeError();
  if (error.what.empty()) return absl::OkStatus();
  if (error.fatal) return absl::InternalError(error.what);
  return absl::ResourceExhaustedError(
      absl::StrCat("not enough memory on ", backend.name(), ": ", error.what,
                   "; a smaller view, or fewer at once, take less"));
}

// Calls `work`, a function that returns absl::Status or absl::StatusOr<T>, while holding the device
// lock (Backend::exclusive_use), and returns its result. If the backend failed meanwhile, returns
// the backend's error instead and clears it unless it is fatal, so that the next holder starts
// without it. The lock is
// not recursive: `work` must not call WithDeviceLock.
template <typename Work>
auto WithDeviceLock(Backend& backend, Work&& work) -> decltype(work()) {
  const std::lock_guard lock(backend.exclusive_use());
  auto answer = std::forward<Work>(work)();
  if (absl::Status status = TakeStatus(backend); !status.ok()) return status;
  return answer;
}

}  // namespace pepeseg
