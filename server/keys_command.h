#pragma once

#include <functional>

#include "absl/status/status.h"
#include "server/server.h"

namespace CLI {
class App;
}

namespace pepeseg {

// `pepesegd keys create`, `keys list` and `keys revoke`: straight in the database, so that a first
// key can be made before a server demands one, and while another process serves. Parsing one of
// them sets `command`, which prints to standard output what there is to tell.
void AddKeysCommand(CLI::App& app, const ServerOptions& server,
                    std::function<absl::Status()>& command);

}  // namespace pepeseg
