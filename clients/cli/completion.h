#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace pepeseg::client::cli {

// A script that completes verbs, options, limited values and training options of `app`, for
// "bash" or "zsh".
std::string CompletionScript(const CLI::App& app, const std::string& shell);

}  // namespace pepeseg::client::cli
