#include "clients/cli/prompt.h"

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cli/connection.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {
namespace {

// "120,88.5".
absl::StatusOr<v1::PointsPrompt::Point> ParsePoint(const std::string& text, bool negative) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  v1::PointsPrompt::Point point;
  double x = 0;
  double y = 0;
  if (parts.size() != 2 || !absl::SimpleAtod(parts[0], &x) || !absl::SimpleAtod(parts[1], &y)) {
    return absl::InvalidArgumentError(
        absl::StrCat("point \"", text, "\": x,y in pixels is wanted, as 320,240"));
  }
  point.set_x(x);
  point.set_y(y);
  point.set_negative(negative);
  return point;
}

}  // namespace

void AddPromptFlags(CLI::App& verb, PromptFlags& flags) {
  verb.add_option("SCENE", flags.scene, "Id of the scene")->required();
  verb.add_option("--view", flags.view, "The view that is clicked in")->required();
  verb.add_option("-p,--point", flags.positive, "A pixel of what is meant; may be repeated")
      ->type_name("X,Y")
      ->allow_extra_args(false)
      ->required();
  verb.add_option("-n,--negative", flags.negative, "A pixel of what is not meant")
      ->type_name("X,Y")
      ->allow_extra_args(false);
  verb.add_option("--model", flags.model, "Number of the model")->capture_default_str();
}

std::string ModelName(const std::string& scene, const std::string& model) {
  return absl::StrCat(SceneName(scene), "/models/", model);
}

absl::StatusOr<v1::PointsPrompt> ParsePoints(const PromptFlags& flags) {
  v1::PointsPrompt prompt;
  for (const std::string& text : flags.positive) {
    ASSIGN_OR_RETURN(*prompt.add_points(), ParsePoint(text, false));
  }
  for (const std::string& text : flags.negative) {
    ASSIGN_OR_RETURN(*prompt.add_points(), ParsePoint(text, true));
  }
  return prompt;
}

}  // namespace pepeseg::cli
