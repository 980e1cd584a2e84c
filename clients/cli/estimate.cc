// The verb that tells what a training would take.
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/byte_units.h"
#include "clients/cli/failure.h"
#include "clients/cli/shell.h"
#include "clients/cli/training.h"
#include "clients/cpp/option_setting.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

void PrintEstimate(const v1::EstimateTrainingResponse& estimate) {
  Print(absl::StrFormat("%d photographs of up to %.2f Mpx, %d points, %d files of masks",
                        estimate.num_views(), static_cast<double>(estimate.max_pixels()) * 1e-6,
                        estimate.num_points(), estimate.num_mask_files()));
  for (const auto& stage : estimate.stages()) {
    std::string line = absl::StrFormat("  %-12s device %8.0f MiB  host %8.0f MiB", stage.stage(),
                                       Mib(stage.device_bytes()), Mib(stage.host_bytes()));
    if (stage.has_duration()) absl::StrAppendFormat(&line, "  %d s", stage.duration().seconds());
    Print(line);
  }
  const bool fits = estimate.need_bytes() <= estimate.have_bytes();
  Print(absl::StrFormat("needs up to %.0f MiB of %s; %.0f MiB are there: %s",
                        Mib(estimate.need_bytes()), estimate.device(), Mib(estimate.have_bytes()),
                        fits ? "it fits" : "it does not fit"));
}

absl::Status RunEstimate(const Shell& shell, const TrainingFlags& flags) {
  const Client client(shell.channel);
  v1::EstimateTrainingRequest request;
  request.set_scene(SceneName(flags.scene));
  ASSIGN_OR_RETURN(const std::string dataset, DatasetName(client, request.scene(), flags.dataset));
  request.set_dataset(dataset);
  for (const std::string& setting : Settings(flags)) {
    RETURN_IF_ERROR(SetOption(setting, *request.mutable_options()));
  }
  ASSIGN_OR_RETURN(const v1::EstimateTrainingResponse estimate, client.EstimateTraining(request));
  shell.json ? PrintJson(estimate) : PrintEstimate(estimate);
  return absl::OkStatus();
}

}  // namespace

void AddEstimate(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<TrainingFlags>();
  CLI::App* verb = app.add_subcommand("estimate", "Tell what memory a training would take");
  AddTrainingFlags(*verb, *flags);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunEstimate(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
