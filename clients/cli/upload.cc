#include "clients/cli/upload.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/checksums.h"
#include "clients/cli/failure.h"
#include "clients/cli/send_files.h"
#include "clients/cli/shell.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {
namespace {

constexpr size_t kNamesShown = 10;

absl::StatusOr<v1::CreateUploadRequest> Declare(const std::string& scene,
                                                const DatasetFolder& folder) {
  v1::CreateUploadRequest request;
  request.set_parent(scene);
  for (const FolderFile& file : folder.files) {
    ASSIGN_OR_RETURN(const FileDigest digest, DigestFile(file.path));
    v1::FileDeclaration* declaration = request.add_files();
    declaration->set_path(file.name);
    declaration->set_kind(file.kind);
    declaration->set_size(digest.size);
    declaration->set_sha256(digest.sha256);
  }
  return request;
}

// The same for the same files, so that the program finds an upload again that it has begun before.
std::string RequestIdOf(const v1::CreateUploadRequest& request) {
  Sha256 digest;
  for (const v1::FileDeclaration& file : request.files()) {
    digest.Add(absl::StrCat(file.path(), "\n", static_cast<int>(file.kind()), " ", file.size(), " ",
                            file.sha256(), "\n"));
  }
  return absl::StrCat("files-", digest.Finish());
}

absl::StatusOr<v1::Upload> Create(const Connection& connection,
                                  const v1::CreateUploadRequest& request) {
  v1::Upload upload;
  Call call(request.parent(), kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(connection.datasets->CreateUpload(call, request, &upload)));
  return upload;
}

// One that goes on, or a new one where that was sealed.
absl::StatusOr<v1::Upload> Open(const Connection& connection, const std::string& scene,
                                const DatasetFolder& folder) {
  ASSIGN_OR_RETURN(v1::CreateUploadRequest request, Declare(scene, folder));
  request.set_request_id(RequestIdOf(request));
  ASSIGN_OR_RETURN(v1::Upload upload, Create(connection, request));
  if (!upload.sealed()) return upload;
  request.set_request_id(NewRequestId());
  return Create(connection, request);
}

void NoteLeftOut(const std::vector<std::string>& names) {
  for (size_t i = 0; i < std::min(names.size(), kNamesShown); ++i) {
    Note(absl::StrCat("left out, no part of a dataset: ", names[i]));
  }
  if (names.size() > kNamesShown) {
    Note(absl::StrCat("... and ", names.size() - kNamesShown, " more"));
  }
}

struct UploadFlags {
  std::string scene;
  std::string folder;
  std::string depth_kind = "depth";
  bool dry_run = false;
};

absl::Status RunUpload(const Shell& shell, const UploadFlags& flags) {
  const v1::FileKind in_depth =
      flags.depth_kind == "depth" ? v1::FILE_KIND_DEPTH : v1::FILE_KIND_DISPARITY;
  ASSIGN_OR_RETURN(const DatasetFolder folder, ReadDatasetFolder(flags.folder, in_depth));
  NoteLeftOut(folder.left_out);
  if (!Has(folder, v1::FILE_KIND_POSES)) {
    Note("no poses among them: the training will estimate them (its stage sfm)");
  }
  if (flags.dry_run) {
    for (const FolderFile& file : folder.files) {
      Print(absl::StrFormat("%-22s %s", v1::FileKind_Name(file.kind).substr(10), file.name));
    }
    return absl::OkStatus();
  }
  const Connection connection(shell.channel);
  const std::string scene = SceneName(flags.scene);
  RETURN_IF_ERROR(EnsureScene(connection, scene));
  ASSIGN_OR_RETURN(const v1::Dataset dataset, UploadFolder(connection, scene, folder));
  if (shell.json) {
    PrintJson(dataset);
  } else {
    Print(absl::StrFormat("%s: %d files, %.1f MB. Next: pepeseg train %s", dataset.name(),
                          dataset.num_files(), static_cast<double>(dataset.num_bytes()) * 1e-6,
                          flags.scene));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Dataset> UploadFolder(const Connection& connection, const std::string& scene,
                                         const DatasetFolder& folder) {
  ASSIGN_OR_RETURN(v1::Upload upload, Open(connection, scene, folder));
  return FinishUpload(connection, std::move(upload), folder);
}

absl::Status EnsureScene(const Connection& connection, const std::string& scene) {
  v1::CreateSceneRequest request;
  request.set_scene_id(scene.substr(std::string("scenes/").size()));
  request.set_request_id(NewRequestId());
  v1::Scene answer;
  Call call(scene, kCallSeconds);
  const absl::Status status = FromGrpc(connection.scenes->CreateScene(call, request, &answer));
  return status.code() == absl::StatusCode::kAlreadyExists ? absl::OkStatus() : status;
}

void AddUpload(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<UploadFlags>();
  CLI::App* verb =
      app.add_subcommand("upload", "Bring photographs or a video, and what is known of them");
  verb->add_option("SCENE", flags->scene, "Id of the scene; made when it is not there")->required();
  verb->add_option(
          "FOLDER", flags->folder,
          "A folder of photographs, or a video; a folder with images/ (or videos/) and, if "
          "there: sparse/0/ (COLMAP), masks/, ignore_mask.png, ignore/, depth/, "
          "disparity/, points.ply, gaussians.ply (taken in place of stage one)")
      ->required();
  verb->add_option("--depth-kind", flags->depth_kind,
                   "What depth/ holds: \"depth\" (far is large, 0 unknown) or \"disparity\" (near "
                   "is large), as disparity/ always does")
      ->check(CLI::IsMember({"depth", "disparity"}))
      ->capture_default_str();
  verb->add_flag("--dry-run", flags->dry_run, "Only tell what would be brought, as what");
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunUpload(shell, *flags); }; });
}

}  // namespace pepeseg::cli
