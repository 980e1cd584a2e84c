#pragma once

#include <string>

#include "clients/terminal/shell.h"

namespace pepeseg::client::cli {

// A command-line program of a pepeseg server.
struct Program {
  std::string name, description;
  void (*add_verbs)(CLI::App& app, Shell& shell);  // in the order in which --help lists them
};

// The main function of a program: parses the command line, opens the channel, runs the verb,
// prints an error, and returns the exit code (see failure.h).
int RunProgram(const Program& program, int argc, char** argv);

}  // namespace pepeseg::client::cli
