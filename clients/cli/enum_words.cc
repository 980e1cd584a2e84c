#include "clients/cli/enum_words.h"

#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace pepeseg::client::cli {
namespace {

// `name`: the name of the value, which begins with `prefix`; empty: it is not known.
std::string Word(int value, const std::string& name, std::string_view prefix) {
  if (value == 0) return "";
  if (name.empty()) return absl::StrCat(value);
  return absl::AsciiStrToLower(name.substr(prefix.size()));
}

}  // namespace

std::string WordOf(v1::JobState state) {
  return Word(state, v1::JobState_Name(state), "JOB_STATE_");
}

std::string WordOf(v1::JobStage stage) {
  return Word(stage, v1::JobStage_Name(stage), "JOB_STAGE_");
}

std::string WordOf(v1::JobEvent::TermSkipped::Term term) {
  return Word(term, v1::JobEvent::TermSkipped::Term_Name(term), "TERM_");
}

std::string WordOf(v1::Scope scope) { return Word(scope, v1::Scope_Name(scope), "SCOPE_"); }

std::string WordOf(v1::ServerStatus::Work work) {
  return Word(work, v1::ServerStatus::Work_Name(work), "WORK_");
}

}  // namespace pepeseg::client::cli
