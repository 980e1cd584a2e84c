#pragma once

#include <span>
#include <string>
#include <vector>

namespace pepeseg::client::cli {

// An option of a training as --list-options shows it, without asking a server. A test compares the
// table with the defaults and ranges of the server.
struct OptionRow {
  const char* name;           // "reconstruct.num_steps"
  const char* default_value;  // in the preset "standard"
  const char* range;          // "1 to 10000000"; "": the values of its enum type
};

// Returns every option of the contract.
std::span<const OptionRow> OptionRows();

// Returns the lines of the table for --list-options: name, default, and range or values.
std::vector<std::string> OptionTable();

}  // namespace pepeseg::client::cli
