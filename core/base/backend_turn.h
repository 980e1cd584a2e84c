#pragma once

#include <mutex>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "kernels/backend.h"

namespace pepeseg {

// What has failed on a backend since it was asked last, see Backend::TakeError: RESOURCE_EXHAUSTED
// for memory that could not be had, after which the backend goes on, INTERNAL for what is fatal.
inline absl::Status TakeStatus(Backend& backend) {
  const BackendError error = backend.TakeError();
  if (error.what.empty()) return absl::OkStatus();
  if (error.fatal) return absl::InternalError(error.what);
  return absl::ResourceExhaustedError(
      absl::StrCat("not enough memory on ", backend.name(), ": ", error.what,
                   "; a smaller view, or fewer at once, take less"));
}

// What `work`, an absl::Status() or absl::StatusOr<T>(), answers while nobody else who takes turns
// uses the backend, or else the backend's error: it is of this work, and the next turn starts
// without it. Not to be called within a turn.
template <typename Work>
auto InTurn(Backend& backend, Work&& work) -> decltype(work()) {
  const std::lock_guard lock(backend.exclusive_use());
  auto answer = std::forward<Work>(work)();
  if (absl::Status status = TakeStatus(backend); !status.ok()) return status;
  return answer;
}

}  // namespace pepeseg
