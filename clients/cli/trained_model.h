#pragma once

#include "clients/cli/shell.h"
#include "clients/cpp/client.h"

namespace pepeseg::client::cli {

// Prints what `model` was trained on, advice, the scores of its held-out views, and the command to
// type next.
absl::Status PrintTrained(const Shell& shell, const Client& client, const std::string& model);

}  // namespace pepeseg::client::cli
