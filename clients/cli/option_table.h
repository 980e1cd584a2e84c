#pragma once

#include <span>
#include <string>
#include <vector>

namespace pepeseg::client::cli {

// An option of a training as people are shown it. The server decides: a test holds both together.
struct OptionRow {
  const char* name;           // "reconstruct.num_steps"
  const char* default_value;  // of the preset standard
  const char* range;          // "1 to 10000000"; empty: one of the names of its type
};

// Every option of the contract.
std::span<const OptionRow> OptionRows();

// The table for `--list-options`: name, default and range or values, a line each.
std::vector<std::string> OptionTable();

}  // namespace pepeseg::client::cli
