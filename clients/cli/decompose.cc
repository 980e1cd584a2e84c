// The verb that takes a model apart, and fetches the pieces.
#include <filesystem>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/failure.h"
#include "clients/cli/prompt.h"
#include "clients/cli/questions.h"
#include "clients/cli/segment_colors.h"
#include "clients/cli/segment_tree.h"
#include "clients/cli/shell.h"
#include "clients/cli/subset.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using Response = v1::DecomposeResponse;

struct DecomposeFlags {
  std::string scene;
  std::string model = "live";
  std::vector<double> scales;
  std::string out;
  int level = -1;  // of what is written; -1: the middle one
};

absl::StatusOr<int> ChooseLevel(const DecomposeFlags& flags, const Response& answer) {
  if (flags.level < answer.levels_size()) {
    return flags.level < 0 ? answer.levels_size() / 2 : flags.level;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--level ", flags.level, ": there are ", answer.levels_size(), ", from 0"));
}

// level_N/segment_ID.ply.
absl::Status WriteSegments(const Client& client, const DecomposeFlags& flags,
                           const Response& answer, int level) {
  const fs::path folder = fs::path(flags.out) / absl::StrCat("level_", level);
  v1::ExportSelectionRequest request;
  request.set_model(answer.model());
  v1::SegmentRef& segment = *request.mutable_subset()->mutable_segment();
  for (const auto& of_level : answer.levels()) segment.add_scales(of_level.scale_quantile());
  segment.set_level(level);
  for (const Response::Segment& written : answer.levels(level).segments()) {
    segment.set_id(written.id());
    const fs::path file = folder / absl::StrCat("segment_", written.id(), ".ply");
    RETURN_IF_ERROR(client.Export(request, file.string()).status());
  }
  return absl::OkStatus();
}

// STEM_ids.png of each view, 16-bit grey, as the server has made it, and STEM_colors.png.
absl::Status WriteViews(const Client& client, const DecomposeFlags& flags, const Response& answer,
                        int level) {
  v1::RenderRequest request;
  request.set_model(answer.model());
  request.set_content(v1::RenderRequest::CONTENT_SEGMENTS);
  for (const auto& of_level : answer.levels()) {
    request.add_decomposition_scales(of_level.scale_quantile());
  }
  request.set_level(level);
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(answer.model()));
  for (const v1::View& view : views) {
    request.mutable_viewpoint()->set_view(view.view());
    ASSIGN_OR_RETURN(const v1::RenderResponse picture, client.Render(request));
    ASSIGN_OR_RETURN(const Grey16Picture ids, DecodeGrey16(picture.png(), view.view()));
    const std::string stem = (fs::path(flags.out) / Stem(view.view())).string();
    RETURN_IF_ERROR(WriteFile(stem + "_ids.png", picture.png()));
    RETURN_IF_ERROR(WritePng(stem + "_colors.png", ColorSegments(ids)));
  }
  return absl::OkStatus();
}

absl::Status RunDecompose(const Shell& shell, const DecomposeFlags& flags) {
  const Client client(shell.channel);
  v1::DecomposeRequest request;
  request.set_model(ModelName(flags.scene, flags.model));
  request.mutable_scales()->Add(flags.scales.begin(), flags.scales.end());
  ASSIGN_OR_RETURN(const Response answer, client.Decompose(request));
  ASSIGN_OR_RETURN(const int level, ChooseLevel(flags, answer));
  if (shell.json) {
    PrintJson(answer);
  } else {
    for (const std::string& line : SegmentTree(answer)) Print(line);
  }
  if (flags.out.empty()) return absl::OkStatus();
  RETURN_IF_ERROR(WriteSegments(client, flags, answer, level));
  RETURN_IF_ERROR(WriteViews(client, flags, answer, level));
  Note(absl::StrFormat("%d segments of level %d and pictures of the views are in %s",
                       answer.levels(level).segments_size(), level, flags.out));
  return absl::OkStatus();
}

}  // namespace

void AddDecompose(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<DecomposeFlags>();
  CLI::App* verb =
      app.add_subcommand("decompose", "Take a model apart into parts, objects and groups");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  AddScalesFlag(*verb, flags->scales);
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  verb->add_option(
      "--out", flags->out,
      "Folder for level_N/segment_ID.ply and, of each view, STEM_ids.png (16-bit grey: "
      "the segment's id, 0 for none) and STEM_colors.png");
  verb->add_option("--level", flags->level, "Which level is written; the middle one by default")
      ->check(CLI::NonNegativeNumber);
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunDecompose(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
