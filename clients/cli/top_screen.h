#pragma once

#include <string>
#include <vector>

#include "absl/time/time.h"
#include "pepeseg/v1/admin_service.pb.h"
#include "pepeseg/v1/server_status.pb.h"

namespace pepeseg::client::cli {

struct TopSnapshot {
  v1::ServerStatus status;
  v1::ListResidentResponse resident;
};

// The screen of `pepeseg top`: the server, its pools, the jobs that run, the models in memory.
std::vector<std::string> TopLines(const TopSnapshot& snapshot, absl::Time now);

}  // namespace pepeseg::client::cli
