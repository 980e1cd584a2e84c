#pragma once

#include <filesystem>
#include <string>

namespace pepeseg::client::cli {

// How to get a server at `server`, as a sentence with a command that can be pasted; without the
// command where no server program is found, and where `server` is another machine or speaks TLS.
std::string StartAdvice(const std::string& server);

// The command that starts a server for who has the programs in `folder`: pepesegd there by its full
// path, else that of PATH; empty: there is none. For a shell.
std::string StartCommand(const std::string& server, const std::filesystem::path& folder);

}  // namespace pepeseg::client::cli
