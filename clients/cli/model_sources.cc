#include "clients/cli/model_sources.h"

#include <map>

#include "absl/strings/str_cat.h"
#include "clients/cli/failure.h"
#include "clients/cli/shell.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {

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

absl::Status PrintSources(const Connection& connection, const std::string& model) {
  v1::GetModelRequest request;
  request.set_name(model);
  v1::Model answer;
  Call call(SceneOf(model), kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(connection.scenes->GetModel(call, request, &answer)));
  const std::string text = SourcesText(answer);
  if (!text.empty()) Print("trained on: " + text);
  return absl::OkStatus();
}

}  // namespace pepeseg::cli
