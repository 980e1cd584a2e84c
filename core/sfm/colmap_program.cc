#include "core/sfm/colmap_program.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr size_t kLastLines = 6;
constexpr absl::Duration kVersionLimit = absl::Seconds(30);

// Appends lines that are not blank to `last` and keeps the newest kLastLines of them.
void KeepLast(std::span<const std::string> lines, std::vector<std::string>& last) {
  for (const std::string& line : lines) {
    if (absl::StripAsciiWhitespace(line).empty()) continue;
    last.push_back(line);
    if (last.size() > kLastLines) last.erase(last.begin());
  }
}

// Returns "COLMAP 3.8" for the line "COLMAP 3.8 -- Structure-from-Motion", and nothing for others.
std::string VersionOf(const std::string& line) {
  const size_t space = line.find(' ');
  if (!absl::StartsWith(line, "COLMAP") || space == std::string::npos) return "";
  return line.substr(0, line.find(' ', space + 1));
}

// Returns the error for a COLMAP that cannot be used, with all remedies.
absl::Status NotThere(const std::string& name, absl::string_view why) {
  return absl::FailedPreconditionError(absl::StrCat(
      "there are no poses among the files, and COLMAP, which estimates them, cannot be run (", name,
      ": ", why,
      "): install it (Debian's package colmap) or name it by pepesegd --colmap=PROGRAM, ",
      "or upload poses"));
}

}  // namespace

absl::StatusOr<ColmapProgram> ColmapProgram::Open(const std::string& name,
                                                  const std::filesystem::path& log) {
  absl::StatusOr<std::filesystem::path> path = FindProgram(name);
  if (!path.ok()) return NotThere(name, path.status().message());
  ColmapProgram program(*std::move(path), log);
  // "colmap help" is the shortest command that prints the version.
  const absl::Status asked = program.Run({"help", {}, ""}, absl::Now() + kVersionLimit,
                                         [&](std::span<const std::string> lines) {
                                           for (const std::string& line : lines) {
                                             if (program.version_.empty())
                                               program.version_ = VersionOf(line);
                                           }
                                           return absl::OkStatus();
                                         });
  if (!asked.ok()) return NotThere(name, asked.message());
  if (program.version_.empty()) return NotThere(name, "it does not report COLMAP's version");
  return program;
}

absl::Status ColmapProgram::Run(const Command& command, absl::Time deadline,
                                ChildWatchFn watch) const {
  ChildCommand child;
  child.program = program_;
  child.arguments = {command.name};
  child.arguments.insert(child.arguments.end(), command.arguments.begin(), command.arguments.end());
  // All commands initialise Qt, which needs a platform without a screen. glog writes to the output
  // instead of to files in /tmp.
  child.environment = {"QT_QPA_PLATFORM=offscreen", "GLOG_logtostderr=1"};
  child.log = log_;
  child.time_limit = std::max(deadline - absl::Now(), absl::ZeroDuration());
  std::vector<std::string> last;
  ASSIGN_OR_RETURN(const ChildEnd end, RunChild(child, [&](std::span<const std::string> lines) {
                     KeepLast(lines, last);
                     return watch(lines);
                   }));
  if (end.exit_code == 0 && end.signal == 0) return absl::OkStatus();
  // The mapper exits with a failure if it finds no model. JudgeModels explains that case better.
  const bool no_result = !command.no_result.empty() && end.signal == 0 && !last.empty() &&
                         absl::StrContains(last.back(), command.no_result);
  if (no_result) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("COLMAP's ", command.name, " ", Describe(end),
                                          "; its last words: ", absl::StrJoin(last, " | ")));
}

}  // namespace pepeseg
