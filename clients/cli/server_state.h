#pragma once

#include <string>
#include <vector>

#include "absl/time/time.h"
#include "pepeseg/v1/admin_service.pb.h"
#include "pepeseg/v1/server_status.pb.h"

namespace pepeseg::client::cli {

// What `pepeseg top` shows at one time.
struct TopSnapshot {
  v1::ServerStatus status;
  v1::ListResidentModelsResponse resident;
};

// Returns the lines of the screen: the server, its thread pools, the running jobs, and the models
// in memory.
std::vector<std::string> TopLines(const TopSnapshot& snapshot, absl::Time now);

}  // namespace pepeseg::client::cli
