#pragma once

#include <filesystem>
#include <string>

#include "server/server.h"

namespace CLI {
class App;
}

namespace pepeseg {

// What pepesegd's command line says.
struct Flags {
  ServerOptions server;
  std::filesystem::path port_file;
  int grace_seconds = 10;
  std::string log_level = "info";
};

void AddFlags(CLI::App& app, Flags& flags);
// Paths that a later change of the working directory does not change. After parsing.
void MakePathsAbsolute(Flags& flags);

}  // namespace pepeseg
