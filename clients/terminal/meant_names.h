#pragma once

#include <string>

#include "absl/status/status.h"
#include "clients/cpp/client.h"

namespace pepeseg::client::cli {

// The scene and model that a command line names; empty: none.
struct NamedModel {
  std::string scene;
  std::string model = "live";
};

// Returns an error about an unknown scene, or an unknown view of the named model, with the nearest
// names that exist, for which it asks the server. Other errors are returned as they are.
absl::Status WithNearestNames(const Client& client, const NamedModel& named, absl::Status status);

}  // namespace pepeseg::client::cli
