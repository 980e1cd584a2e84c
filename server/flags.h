#pragma once

#include <filesystem>
#include <string>

#include "server/server_options.h"

namespace CLI {
class App;
}

namespace pepeseg {

// The command line of pepesegd.
struct Flags {
  ServerOptions server;
  std::filesystem::path port_file;  // file for the port that the server listens on; empty: none
  int grace_seconds = 10;           // time from SIGTERM to the end of the process
  std::string log_level = "info";
};

// Adds the flags of `flags` to `app`, with their defaults.
void AddFlags(CLI::App& app, Flags& flags);
// Makes relative paths absolute, so that they do not depend on the working directory. Call it after
// parsing.
void MakePathsAbsolute(Flags& flags);

}  // namespace pepeseg
