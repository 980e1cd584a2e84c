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

void AddGranularityFlags(CLI::App& verb, GranularityFlags& flags) {
  verb.add_option("--scale", flags.scale, "How large a thing: 0 a small part, 1 the largest")
      ->check(CLI::Range(0.0, 1.0));
  verb.add_option("--threshold", flags.threshold, "Cosine over which a pixel is in")
      ->check(CLI::Range(-1.0, 1.0));
}

v1::Granularity ToGranularity(const GranularityFlags& flags) {
  v1::Granularity granularity;
  if (flags.scale >= 0) granularity.set_scale_quantile(flags.scale);
  if (flags.threshold >= -1) granularity.set_threshold(flags.threshold);
  return granularity;
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

absl::StatusOr<v1::Prompt> ParsePrompt(const PromptFlags& flags) {
  v1::Prompt prompt;
  prompt.mutable_view()->set_view(flags.view);
  ASSIGN_OR_RETURN(*prompt.mutable_points(), ParsePoints(flags));
  return prompt;
}

}  // namespace pepeseg::cli
