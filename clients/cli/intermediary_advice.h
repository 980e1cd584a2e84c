#pragma once

#include <string>

#include "absl/status/status.h"

namespace pepeseg::client::cli {

// What to do about an error that has no ErrorDetail, as of what stands between this program and the
// server (clients/cpp/answer_status.h); empty where nothing is known.
std::string IntermediaryAdvice(const absl::Status& status);

}  // namespace pepeseg::client::cli
