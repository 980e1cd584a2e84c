// The verb "correct": masks of a thing teach the model what it is.
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/shell.h"

namespace pepeseg::client::cli {
namespace {

struct CorrectFlags {
  std::string scene, model = "live";
  std::vector<std::string> masks;  // "VIEW=FILE"
  double scale = -1;               // quantile; below 0: the server chooses
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;
};

// Reads "VIEW=FILE". The name of a view may have a '=', that of the file may not.
absl::Status AddMask(const std::string& text, v1::CorrectSegmentRequest& request) {
  const size_t equals = text.rfind('=');
  if (equals == std::string::npos || equals == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("--mask \"", text, "\": must be VIEW=FILE, such as a.jpg=mug.png"));
  }
  v1::Prompt prompt;
  RETURN_IF_ERROR(AddToPrompt("mask", text.substr(equals + 1), prompt));
  auto& correction = *request.add_corrections();
  correction.mutable_view()->set_view(text.substr(0, equals));
  *correction.mutable_mask() = std::move(*prompt.mutable_mask());
  return absl::OkStatus();
}

void PrintAnswer(const v1::CorrectSegmentResponse& answer) {
  Print(absl::StrFormat("%s  corrected from %s  scale %.3f (%.4g scene units)  threshold %.3f",
                        answer.model(), answer.corrected_from(), answer.scale_quantile(),
                        answer.scale_units(), answer.threshold()));
  for (const auto& score : answer.scores()) {
    Print(absl::StrFormat("  %-28s IoU %.3f, was %.3f", score.view(), score.iou_after(),
                          score.iou_before()));
  }
}

absl::Status RunCorrect(const Shell& shell, const CorrectFlags& flags) {
  v1::CorrectSegmentRequest request;
  request.set_model(ModelName(flags.scene, flags.model));
  request.set_frame(flags.frame);
  if (flags.scale >= 0) request.mutable_granularity()->set_scale_quantile(flags.scale);
  for (const std::string& mask : flags.masks) RETURN_IF_ERROR(AddMask(mask, request));
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::CorrectSegmentResponse answer, client.Correct(request));
  shell.json ? PrintJson(answer) : PrintAnswer(answer);
  if (answer.model() == answer.corrected_from()) {
    Note("no change finds the masks better: the model stays as it is");
    return absl::OkStatus();
  }
  Note(absl::StrCat("undo: pepeseg models ", flags.scene, " ",
                    answer.corrected_from().substr(answer.corrected_from().rfind('/') + 1),
                    " --live"));
  return absl::OkStatus();
}

}  // namespace

void AddCorrect(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<CorrectFlags>();
  CLI::App* verb = app.add_subcommand(
      "correct", "Teach the model what a thing is, by its masks in one or more views");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  verb->add_option(
          "--mask", flags->masks,
          "A view, and a grey PNG of the frame's size: 0 outside the thing; may be repeated")
      ->type_name("VIEW=FILE")
      ->allow_extra_args(false)
      ->required();
  verb->add_option("--scale", flags->scale, "Size of the thing: 0 a small part, 1 the largest")
      ->check(CLI::Range(0.0, 1.0));
  AddFrameFlag(*verb, flags->frame);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunCorrect(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
