#include "server/store/schema.h"

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace pepeseg {

std::vector<std::string> SchemaStatements() {
  std::string text;
  for (const absl::string_view line : absl::StrSplit(kSchemaText, '\n')) {
    // SOCI would take a ':' of a comment for a placeholder.
    absl::StrAppend(&text, line.substr(0, line.find("--")), "\n");
  }
  std::vector<std::string> statements;
  for (const absl::string_view part : absl::StrSplit(text, ';')) {
    const absl::string_view statement = absl::StripAsciiWhitespace(part);
    if (!statement.empty()) statements.emplace_back(statement);
  }
  return statements;
}

}  // namespace pepeseg
