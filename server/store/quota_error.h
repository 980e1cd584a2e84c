#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace pepeseg {

// RESOURCE_EXHAUSTED: a project would take `need` of what pepeseg.v1.Quota calls `name`, and may
// take `limit`. With an ErrorDetail of reason QUOTA that says so.
absl::Status QuotaError(const std::string& name, int64_t need, int64_t limit);

}  // namespace pepeseg
