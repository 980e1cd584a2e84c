// The verb "mesh": triangles of a model, or of a part of it.
#include <memory>
#include <string>

#include "absl/strings/ascii.h"
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

struct MeshFlags {
  std::string scene;
  std::string file;  // to write
  std::string model = "live";
  std::string format;  // empty: that of the file's name
  std::string origin = "local";
  int voxels = 256;
  bool watertight = false;
  int64_t max_triangles = 0;
  SubsetFlags subset;
};

absl::Status RunMesh(const Shell& shell, const MeshFlags& flags) {
  v1::ExportMeshRequest request;
  request.set_model(ModelName(flags.scene, flags.model));
  ASSIGN_OR_RETURN(*request.mutable_subset(), ParseSubset(flags.subset, flags.scene));
  const bool is_glb = flags.format.empty() ? absl::AsciiStrToLower(flags.file).ends_with(".glb")
                                           : flags.format == "glb";
  request.set_format(is_glb ? v1::MESH_FORMAT_GLB : v1::MESH_FORMAT_PLY);
  request.set_coordinates(flags.origin == "local" ? v1::COORDINATES_LOCAL : v1::COORDINATES_WORLD);
  request.set_voxels(flags.voxels);
  request.set_watertight(flags.watertight);
  request.set_max_triangles(flags.max_triangles);
  ASSIGN_OR_RETURN(const v1::ExportMeshResponse::Header header,
                   Client(shell.channel).ExportMesh(request, flags.file));
  ASSIGN_OR_RETURN(const std::string origin,
                   WriteOrigin(header.has_origin() ? &header.origin() : nullptr, flags.file));
  if (shell.json) {
    PrintJson(header);
    return absl::OkStatus();
  }
  Print(absl::StrFormat("%s: %d triangles, %d vertices, %.1f MB, of %s", flags.file,
                        header.num_triangles(), header.num_vertices(),
                        static_cast<double>(header.num_bytes()) * 1e-6, header.model()));
  if (!origin.empty()) {
    Print(absl::StrCat("positions are relative to the origin in ", origin,
                       is_glb ? "" : " and in the PLY's comment", "; --origin world adds it"));
  }
  return absl::OkStatus();
}

}  // namespace

void AddMesh(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<MeshFlags>();
  CLI::App* verb = app.add_subcommand(
      "mesh", "Make a triangle mesh of a model, or of a part of it, with colours");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("FILE", flags->file, "File to write")->required();
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  verb->add_option("--format", flags->format,
                   "ply or glb (glTF). By default what FILE ends in, .glb, else ply")
      ->check(CLI::IsMember({"ply", "glb"}));
  verb->add_option("--voxels", flags->voxels,
                   "Voxels on the longest side: more show smaller things, and take longer")
      ->check(CLI::Range(32, 1024))
      ->capture_default_str();
  verb->add_flag("--watertight", flags->watertight,
                 "Close the surface where no photograph shows it, for printing and for volumes");
  verb->add_option(
          "--triangles", flags->max_triangles,
          "Most triangles: they are merged where the surface changes least. By default all")
      ->check(CLI::Range(int64_t{100}, int64_t{1'000'000'000}));
  verb->add_option(
          "--origin", flags->origin,
          "Positions of a scene with map coordinates. local: floats relative to an origin, "
          "which is in FILE.origin.json and in a comment of the PLY; world: doubles in a PLY, a "
          "moved node in a GLB")
      ->check(CLI::IsMember({"local", "world"}))
      ->capture_default_str();
  AddSubsetFlags(*verb, flags->subset);
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunMesh(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
