#include "core/sfm/colmap_program.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
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

// Returns the numbers of a text in front of the first `end`, in order: 3 and 20 for "3/20] x" and
// ']'.
std::vector<int64_t> NumbersBefore(absl::string_view text, char end) {
  std::vector<int64_t> numbers;
  // A number that does not fit into 64 bits is left out: the output of a program is not trusted.
  for (size_t at = 0; at < text.size() && text[at] != end;) {
    size_t length = 0;
    while (at + length < text.size() &&
           absl::ascii_isdigit(static_cast<unsigned char>(text[at + length]))) {
      ++length;
    }
    int64_t number = 0;
    if (length > 0 && absl::SimpleAtoi(text.substr(at, length), &number)) numbers.push_back(number);
    at += std::max<size_t>(length, 1);
  }
  return numbers;
}

// Returns the first number after the text `before`, if it is followed by one.
std::optional<int64_t> NumberAfter(absl::string_view line, absl::string_view before) {
  const size_t at = line.find(before);
  if (at == absl::string_view::npos) return std::nullopt;
  const std::vector<int64_t> numbers = NumbersBefore(line.substr(at + before.size()), ')');
  if (numbers.empty()) return std::nullopt;
  return numbers.front();
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

std::string_view ColmapProgress::activity() const {
  switch (part_) {
    case kExtracting:
      return "finding features in";
    case kMatching:
      return "matching";
    case kMapping:
      return "placing";
    default:
      return "";
  }
}

std::string_view ColmapProgress::unit() const {
  if (part_ == kNone) return "";
  return part_ == kMatching && by_blocks_ ? "pairs" : "photographs";
}

// Sums the work of the parts before the current one and the done share of the current one.
double ColmapProgress::share() const {
  if (part_ == kNone) return 0;
  const double parts[] = {work_.extracting, work_.matching, work_.mapping};
  double done = 0;
  for (int part = 0; part < part_; ++part) done += parts[part];
  if (num_steps_ > 0) {
    done += parts[part_] * static_cast<double>(step_) / static_cast<double>(num_steps_);
  }
  return work_.sum() > 0 ? done / work_.sum() : 0;
}

void ColmapProgress::Reach(Part part, int64_t done, int64_t of) {
  // Numbers of COLMAP may restart (a second model of the mapper), so steps are kept from falling.
  if (of <= 0 || part < part_) return;
  if (part > part_) step_ = 0;
  part_ = part;
  num_steps_ = part == kMatching && by_blocks_ ? num_pairs_ : num_photographs_;
  step_ = std::max(step_, num_steps_ * std::clamp<int64_t>(done, 0, of) / of);
}

void ColmapProgress::Finish() { Reach(kMapping, 1, 1); }

// Reads "[5/20]", a count of photographs, or "[1/4, 3/4]", a position in the square of blocks,
// which COLMAP compares row by row.
void ColmapProgress::ReadMatching(absl::string_view counts) {
  const std::vector<int64_t> numbers = NumbersBefore(counts, ']');
  if (numbers.size() == 2) Reach(kMatching, numbers[0], numbers[1]);
  // by_blocks_ changes the unit, so a stray line of a later part must not set it.
  if (numbers.size() != 4 || part_ > kMatching) return;
  by_blocks_ = true;
  Reach(kMatching, (numbers[0] - 1) * numbers[3] + numbers[2], numbers[1] * numbers[3]);
}

void ColmapProgress::Read(absl::string_view line) {
  line = absl::StripAsciiWhitespace(line);
  if (absl::ConsumePrefix(&line, "Processed file [")) {
    const std::vector<int64_t> counts = NumbersBefore(line, ']');
    if (counts.size() == 2) Reach(kExtracting, counts[0], counts[1]);
  } else if (absl::ConsumePrefix(&line, "Name:")) {
    name_ = std::string(absl::StripAsciiWhitespace(line));
  } else if (absl::ConsumePrefix(&line, "Features:")) {
    const std::vector<int64_t> count = NumbersBefore(line, '\n');
    if (!count.empty() && !name_.empty()) num_features_[name_] = count.front();
  } else if (absl::ConsumePrefix(&line, "Matching image [") ||
             absl::ConsumePrefix(&line, "Matching block [")) {
    ReadMatching(line);
  } else if (absl::StartsWith(line, "Loading images...")) {
    num_connected_ = NumberAfter(line, "(connected").value_or(num_connected_);
  } else if (absl::StartsWith(line, "Registering image #")) {
    // The number in brackets counts the photograph that is about to be registered.
    const std::optional<int64_t> number = NumberAfter(line, "(");
    if (number) Reach(kMapping, *number - 1, num_photographs_);
  }
}

}  // namespace pepeseg
