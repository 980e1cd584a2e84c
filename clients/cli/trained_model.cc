#include "clients/cli/trained_model.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "clients/cli/model_sources.h"
#include "clients/cli/next_command.h"
#include "clients/cli/score_table.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {

absl::Status PrintTrained(const Shell& shell, const Client& client, const std::string& model) {
  ASSIGN_OR_RETURN(const v1::Model answer, client.GetModel(model));
  if (answer.sources_size() > 0) Print("trained on: " + SourcesText(answer));
  if (const std::string quality = MaskQualityText(answer); !quality.empty()) Print(quality);
  PrintAdvice(answer);
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(model));
  for (const std::string& row : ScoreTable(views)) Print(row);
  Print(absl::StrCat("Next: ", FirstQuestion(shell, answer, views)));
  return absl::OkStatus();
}

}  // namespace pepeseg::client::cli
