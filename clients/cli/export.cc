// The verb that fetches a model as a PLY for splat viewers.
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/failure.h"
#include "clients/cli/shell.h"
#include "clients/cli/subset.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

struct ExportFlags {
  std::string scene;
  std::string file;
  std::string model = "live";
  SubsetFlags subset;
};

using Header = v1::ExportSelectionResponse::Header;

absl::Status RunExport(const Shell& shell, const ExportFlags& flags) {
  v1::ExportSelectionRequest request;
  request.set_model(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  ASSIGN_OR_RETURN(*request.mutable_subset(), ParseSubset(flags.subset, flags.scene));
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const Header header, client.Export(request, flags.file));
  if (shell.json) {
    PrintJson(header);
  } else {
    Print(absl::StrFormat("%s: %d Gaussians, %.1f MB, of %s", flags.file, header.num_gaussians(),
                          static_cast<double>(header.num_bytes()) * 1e-6, header.model()));
  }
  return absl::OkStatus();
}

}  // namespace

void AddExport(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ExportFlags>();
  CLI::App* verb =
      app.add_subcommand("export", "Fetch a model, or some of it, as a PLY for splat viewers");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("FILE", flags->file, "Where to write it")->required();
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  AddSubsetFlags(*verb, flags->subset);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunExport(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
