#include "clients/cli/model_sources.h"

#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
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

std::string MaskQualityText(const v1::Model& model) {
  const auto quality = model.metrics().find("mask_quality");
  if (quality == model.metrics().end()) return "";
  return absl::StrFormat("mask quality %.2f: how far the masks of different views agree, 0 to 1",
                         quality->second);
}

void PrintAdvice(const v1::Model& model) {
  for (const std::string& advice : model.advice()) Print("advice: " + advice);
}

}  // namespace pepeseg::client::cli
