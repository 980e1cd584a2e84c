#pragma once

#include <string>
#include <vector>

#include "clients/cli/shell.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// A command line of this program that can be pasted into a shell: as the program was called, with
// --server where this call had one that the environment does not name, words quoted.
std::string CommandText(const Shell& shell, const std::vector<std::string>& words);

// Returns a command to try on a new model: a click in the middle of one of its views, or its export
// if it has no features.
std::string FirstQuestion(const Shell& shell, const v1::Model& model,
                          const std::vector<v1::View>& views);

}  // namespace pepeseg::client::cli
