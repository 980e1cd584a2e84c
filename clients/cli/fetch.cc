// The verbs that fetch files of a scene: "export" (a model as a PLY) and "photograph".
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/shell.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

struct ExportFlags {
  std::string scene;
  std::string file;  // to write
  std::string model = "live";
  SubsetFlags subset;
};

// Writes the PLY and prints its size.
absl::Status RunExport(const Shell& shell, const ExportFlags& flags) {
  v1::ExportGaussiansRequest request;
  request.set_model(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  ASSIGN_OR_RETURN(*request.mutable_subset(), ParseSubset(flags.subset, flags.scene));
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::ExportGaussiansResponse::Header header,
                   client.Export(request, flags.file));
  if (shell.json) {
    PrintJson(header);
  } else {
    Print(absl::StrFormat("%s: %d Gaussians, %.1f MB, of %s", flags.file, header.num_gaussians(),
                          static_cast<double>(header.num_bytes()) * 1e-6, header.model()));
  }
  return absl::OkStatus();
}

struct PhotographFlags {
  std::string scene;
  std::string view;
  std::string file;  // to write
  std::string model = "live";
  v1::PixelFrame frame = v1::PIXEL_FRAME_UNSPECIFIED;
  int max_side = 0;       // pixels; 0: not shrunk
  bool original = false;  // the uploaded file, without frame and max_side
};

// Writes the image file and prints its size.
absl::Status RunPhotograph(const Shell& shell, const PhotographFlags& flags) {
  v1::GetPhotographRequest request;
  request.set_parent(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  request.set_photograph(flags.view);
  request.set_max_side(flags.max_side);
  request.set_original(flags.original);
  if (!flags.original) request.set_frame(flags.frame);
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const Client::Photograph photograph, client.GetPhotograph(request));
  RETURN_IF_ERROR(WriteFile(flags.file, photograph.bytes));
  if (shell.json) {
    PrintJson(photograph.header);
    return absl::OkStatus();
  }
  const auto& header = photograph.header;
  const std::string size =
      header.width() > 0 ? absl::StrCat(header.width(), "x", header.height(), ", ") : "";
  Print(absl::StrFormat("%s: %s%.1f MB, %s", flags.file, size,
                        static_cast<double>(header.num_bytes()) * 1e-6, header.content_type()));
  return absl::OkStatus();
}

}  // namespace

void AddExport(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ExportFlags>();
  CLI::App* verb =
      app.add_subcommand("export", "Fetch a model, or a part of it, as a PLY for splat viewers");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("FILE", flags->file, "File to write")->required();
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  AddSubsetFlags(*verb, flags->subset);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunExport(shell, *flags); }; });
}

void AddPhotograph(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<PhotographFlags>();
  CLI::App* verb = app.add_subcommand("photograph", "Fetch the photograph of a view");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("VIEW", flags->view, "Name of the view, as `pepeseg scenes SCENE` prints it")
      ->required();
  verb->add_option("OUT", flags->file, "File to write")->required();
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  verb->add_option("--max-side", flags->max_side,
                   "Longer side to which it is shrunk, pixels; 0: not shrunk")
      ->check(CLI::Range(0, 16384))
      ->capture_default_str();
  CLI::Option* frame = AddFrameFlag(*verb, flags->frame);
  verb->add_flag("--original", flags->original, "Fetch the uploaded file, byte for byte")
      ->excludes(frame)
      ->excludes("--max-side");
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunPhotograph(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
