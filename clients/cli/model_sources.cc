#include "clients/cli/model_sources.h"

#include <map>

#include "absl/strings/str_cat.h"
#include "clients/cli/shell.h"

namespace pepeseg::client::cli {

std::string SourcesText(const v1::Model& model) {
  // In the order in which they are made, then whatever a newer server tells.
  std::map<std::string, std::string> rest(model.sources().begin(), model.sources().end());
  std::string text;
  const auto append = [&text](const std::string& what, const std::string& source) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", what, " ", source);
  };
  for (const char* what : {"poses", "masks", "depth"}) {
    const auto found = rest.find(what);
    if (found == rest.end()) continue;
    append(what, found->second);
    rest.erase(found);
  }
  for (const auto& [what, source] : rest) append(what, source);
  return text;
}

void PrintAdvice(const v1::Model& model) {
  for (const std::string& advice : model.advice()) Print("advice: " + advice);
}

}  // namespace pepeseg::client::cli
