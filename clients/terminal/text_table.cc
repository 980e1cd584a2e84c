#include "clients/terminal/text_table.h"

#include <algorithm>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace pepeseg::client::cli {
namespace {

// Returns the word of an enum value. `name`: the name of the value, which begins with `prefix`;
// empty: it is not known.
std::string Word(int value, const std::string& name, std::string_view prefix) {
  if (value == 0) return "";
  if (name.empty()) return absl::StrCat(value);
  return absl::AsciiStrToLower(name.substr(prefix.size()));
}

}  // namespace

std::vector<std::string> TextTable(const std::vector<TableRow>& rows) {
  std::vector<size_t> widths;  // of the columns; rows may have different numbers of cells
  for (const TableRow& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::vector<std::string> lines;
  for (const TableRow& row : rows) {
    std::string line;
    for (size_t i = 0; i < row.size(); ++i) {
      absl::StrAppendFormat(&line, "%s%-*s", i == 0 ? "" : "  ", static_cast<int>(widths[i]),
                            row[i]);
    }
    // The padding of the last column is not wanted.
    lines.emplace_back(absl::StripTrailingAsciiWhitespace(line));
  }
  return lines;
}

std::string SpanText(absl::Duration span) {
  const int64_t seconds = std::max<int64_t>(0, absl::ToInt64Seconds(span));
  constexpr int64_t kMinute = 60, kHour = 3600, kDay = 86400;
  if (seconds < kMinute) return absl::StrCat(seconds, " s");
  if (seconds < kHour) return absl::StrCat(seconds / kMinute, " min");
  // Hours up to two days: "1 days" would be too coarse.
  if (seconds < 2 * kDay) return absl::StrCat(seconds / kHour, " h");
  return absl::StrCat(seconds / kDay, " days");
}

absl::Time ToTime(const google::protobuf::Timestamp& time) {
  return absl::FromUnixSeconds(time.seconds()) + absl::Nanoseconds(time.nanos());
}

std::string AgeText(const google::protobuf::Timestamp& time, absl::Time now) {
  return SpanText(now - ToTime(time));
}

std::string SizeText(int64_t bytes) {
  const auto size = static_cast<double>(bytes);
  if (bytes < 1'000'000) return absl::StrFormat("%.0f kB", size * 1e-3);
  if (bytes < 1'000'000'000) return absl::StrFormat("%.1f MB", size * 1e-6);
  return absl::StrFormat("%.1f GB", size * 1e-9);
}

std::string WaitText(const v1::Job::Wait& wait, absl::Time now) {
  switch (wait.reason()) {
    case v1::Job::Wait::REASON_DEVICE:
      if (wait.jobs_ahead() == 0) return "next, when a device is free";
      return absl::StrCat("after ", wait.jobs_ahead(),
                          wait.jobs_ahead() == 1 ? " other" : " others", ", when a device is free");
    case v1::Job::Wait::REASON_QUOTA:
      return "until another job of its project ends, by its quota";
    case v1::Job::Wait::REASON_RETRY:
      return absl::StrCat(SpanText(ToTime(wait.retry_time()) - now), " until the next attempt");
    default:  // a newer server has other reasons
      return "";
  }
}

std::string WordOf(v1::JobState state) {
  return Word(state, v1::JobState_Name(state), "JOB_STATE_");
}

std::string WordOf(v1::JobStage stage) {
  return Word(stage, v1::JobStage_Name(stage), "JOB_STAGE_");
}

std::string WordOf(v1::JobEvent::TermSkipped::Term term) {
  return Word(term, v1::JobEvent::TermSkipped::Term_Name(term), "TERM_");
}

std::string WordOf(v1::ProposeScalesResponse::Kind kind) {
  return Word(kind, v1::ProposeScalesResponse::Kind_Name(kind), "KIND_");
}

std::string WordOf(v1::Scope scope) { return Word(scope, v1::Scope_Name(scope), "SCOPE_"); }

std::string WordOf(v1::ServerStatus::Work work) {
  return Word(work, v1::ServerStatus::Work_Name(work), "WORK_");
}

}  // namespace pepeseg::client::cli
