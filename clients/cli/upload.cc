#include "clients/cli/upload.h"

#include <fstream>
#include <memory>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/checksums.h"
#include "clients/cli/failure.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {
namespace {

constexpr size_t kChunkBytes = size_t{1} << 20;
constexpr size_t kNamesShown = 10;

using FileStream = std::unique_ptr<grpc::ClientWriter<v1::WriteFilesRequest>>;
using FilesByName = std::unordered_map<std::string, const FolderFile*>;

absl::StatusOr<v1::Upload> Declare(const Connection& connection, const std::string& scene,
                                   const DatasetFolder& folder) {
  v1::CreateUploadRequest request;
  request.set_parent(scene);
  request.set_request_id(NewRequestId());
  for (const FolderFile& file : folder.files) {
    ASSIGN_OR_RETURN(const FileDigest digest, DigestFile(file.path));
    v1::FileDeclaration* declaration = request.add_files();
    declaration->set_path(file.name);
    declaration->set_kind(file.kind);
    declaration->set_size(digest.size);
    declaration->set_sha256(digest.sha256);
  }
  v1::Upload upload;
  Call call(scene, kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(connection.datasets->CreateUpload(call, request, &upload)));
  return upload;
}

// False when the server ended the stream; its Finish tells why.
absl::StatusOr<bool> SendFile(FileStream& stream, const std::string& upload, const FolderFile& file,
                              absl::FunctionRef<void(int64_t)> sent) {
  std::ifstream bytes(file.path, std::ios::binary);
  if (!bytes) return absl::NotFoundError(absl::StrCat("cannot open ", file.path.string()));
  v1::WriteFilesRequest request;
  request.mutable_header()->set_upload(upload);
  request.mutable_header()->set_path(file.name);
  if (!stream->Write(request)) return false;
  std::string piece(kChunkBytes, '\0');
  while (bytes) {
    bytes.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    const auto size = static_cast<size_t>(bytes.gcount());
    if (size == 0) break;
    v1::WriteFilesRequest::Chunk* chunk = request.mutable_chunk();
    chunk->set_data(piece.data(), size);
    chunk->set_crc32c(Crc32c(chunk->data()));
    if (!stream->Write(request)) return false;
    sent(static_cast<int64_t>(size));
  }
  request.mutable_end();
  return stream->Write(request);
}

absl::Status SendMissing(const Connection& connection, const v1::Upload& upload,
                         const DatasetFolder& folder, ProgressLine& line) {
  FilesByName files;
  for (const FolderFile& file : folder.files) files[file.name] = &file;
  int64_t num_bytes = 0;
  for (const std::string& name : upload.missing_files()) {
    std::error_code error;
    if (files.count(name) == 0) {
      return absl::InternalError(absl::StrCat("the server asks for an unknown file: ", name));
    }
    num_bytes += static_cast<int64_t>(std::filesystem::file_size(files[name]->path, error));
  }
  v1::WriteFilesResponse response;
  Call call(SceneOf(upload.name()), 0);
  FileStream stream = connection.datasets->WriteFiles(call, &response);
  int64_t bytes = 0;
  for (const std::string& name : upload.missing_files()) {
    auto went = SendFile(stream, upload.name(), *files[name], [&](int64_t size) {
      bytes += size;
      line.Show(UploadText(bytes, num_bytes, line.columns()));
    });
    if (!went.ok()) {
      static_cast<grpc::ClientContext*>(call)->TryCancel();
      (void)stream->Finish();
      return went.status();
    }
    if (!*went) break;
  }
  stream->WritesDone();
  RETURN_IF_ERROR(FromGrpc(stream->Finish()));
  line.Show(UploadText(bytes, num_bytes, line.columns()), /*is_last=*/true);
  return absl::OkStatus();
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
  ASSIGN_OR_RETURN(const v1::Upload upload, Declare(connection, scene, folder));
  ProgressLine line;
  if (upload.missing_files_size() > 0) {
    RETURN_IF_ERROR(SendMissing(connection, upload, folder, line));
  } else {
    line.Say("the server has every file already");
  }
  v1::SealUploadRequest request;
  request.set_name(upload.name());
  v1::Dataset dataset;
  Call call(scene, kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(connection.datasets->SealUpload(call, request, &dataset)));
  return dataset;
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
