#include "clients/cli/start_advice.h"

#include <unistd.h>

#include <cstdlib>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "clients/cli/shell.h"
#include "clients/cpp/channel.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

constexpr char kProgram[] = "pepesegd";

bool IsProgram(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

bool IsInPath() {
  const char* path = std::getenv("PATH");
  if (path == nullptr) return false;
  for (const auto folder : absl::StrSplit(path, ':', absl::SkipEmpty())) {
    if (IsProgram(fs::path(std::string(folder)) / kProgram)) return true;
  }
  return false;
}

std::string Quoted(const std::string& word) {
  constexpr char kPlain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/._-:[]";
  if (word.find_first_not_of(kPlain) == std::string::npos) return word;
  return absl::StrCat("'", absl::StrReplaceAll(word, {{"'", "'\\''"}}), "'");
}

}  // namespace

std::string StartCommand(const std::string& server, const fs::path& folder) {
  std::string command;
  if (IsProgram(folder / kProgram)) {
    command = Quoted((folder / kProgram).string());
  } else if (IsInPath()) {
    command = kProgram;
  } else {
    return "";
  }
  if (server != Shell().server) absl::StrAppend(&command, " --listen ", Quoted(server));
  return command;
}

std::string StartAdvice(const std::string& server) {
  constexpr char kElsewhere[] = "Name another with --server host:port.";
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const std::string command =
      !error && server.find(':') != std::string::npos && IsThisMachine(server)
          ? StartCommand(server, self.parent_path())
          : "";
  if (command.empty()) return kElsewhere;
  return absl::StrCat("Start one with `", command, "`, or name another with --server host:port.");
}

}  // namespace pepeseg::client::cli
