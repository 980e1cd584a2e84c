#pragma once

#include <string>

#include "absl/status/status.h"
#include "clients/cpp/client.h"

namespace pepeseg::client::cli {

// "poses given, masks embedded, depth none", or empty where nobody noted it.
std::string SourcesText(const v1::Model& model);

// That of a model by its name, to standard output; nothing where there is nothing to tell.
absl::Status PrintSources(const Client& client, const std::string& model);

}  // namespace pepeseg::client::cli
