#pragma once

#include <functional>

#include "absl/status/status.h"
#include "server/server_options.h"

namespace CLI {
class App;
}

namespace pepeseg {

// Adds the commands `pepesegd keys create`, `keys list` and `keys revoke`. They work on the
// database itself, so that the first key can be made before the server requires one, and also while
// a server runs. Parsing one of them sets `command`, which runs it and prints its result to
// standard output. `server` and `command` must outlive `app`.
void AddKeysCommand(CLI::App& app, const ServerOptions& server,
                    std::function<absl::Status()>& command);

}  // namespace pepeseg
