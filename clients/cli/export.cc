// The verb that fetches a model as a PLY for splat viewers.
#include "clients/cli/export.h"

#include <filesystem>
#include <fstream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/checksums.h"
#include "clients/cli/connection.h"
#include "clients/cli/failure.h"
#include "clients/cli/shell.h"
#include "clients/cli/status_macros.h"
#include "clients/cli/subset.h"

namespace pepeseg::cli {
namespace {

namespace fs = std::filesystem;

struct ExportFlags {
  std::string scene;
  std::string file;
  std::string model = "live";
  SubsetFlags subset;
};

using Header = v1::ExportSelectionResponse::Header;

// Checks each chunk and the whole; the header is the stream's first message.
absl::StatusOr<Header> Receive(grpc::ClientReader<v1::ExportSelectionResponse>& stream,
                               std::ofstream& file) {
  Header header;
  Sha256 sha256;
  int64_t size = 0;
  v1::ExportSelectionResponse part;
  while (stream.Read(&part)) {
    if (part.has_header()) header = part.header();
    if (!part.has_chunk()) continue;
    const std::string& data = part.chunk().data();
    if (Crc32c(data) != part.chunk().crc32c()) {
      return absl::DataLossError(absl::StrCat("bytes ", size, " to ", size + data.size(),
                                              " of the PLY fail their checksum"));
    }
    sha256.Add(data);
    size += static_cast<int64_t>(data.size());
    file.write(data.data(), static_cast<std::streamsize>(data.size()));
  }
  RETURN_IF_ERROR(FromGrpc(stream.Finish()));
  file.close();
  if (!file) return absl::PermissionDeniedError("cannot write the PLY: is the disk full?");
  if (size != header.num_bytes() || sha256.Finish() != header.sha256()) {
    return absl::DataLossError(absl::StrCat("the PLY is not what was announced: ", size, " of ",
                                            header.num_bytes(), " bytes"));
  }
  return header;
}

absl::Status RunExport(const Shell& shell, const ExportFlags& flags) {
  v1::ExportSelectionRequest request;
  request.set_model(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  ASSIGN_OR_RETURN(*request.mutable_subset(), ParseSubset(flags.subset, flags.scene));
  const Connection connection(shell.channel);
  ASSIGN_OR_RETURN(const Header header, FetchPly(connection, request, flags.file));
  if (shell.json) {
    PrintJson(header);
  } else {
    Print(absl::StrFormat("%s: %d Gaussians, %.1f MB, of %s", flags.file, header.num_gaussians(),
                          static_cast<double>(header.num_bytes()) * 1e-6, header.model()));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Header> FetchPly(const Connection& connection,
                                const v1::ExportSelectionRequest& request,
                                const std::string& file) {
  const fs::path beside = file + ".part";
  std::ofstream part(beside, std::ios::binary | std::ios::trunc);
  if (!part) return absl::PermissionDeniedError(absl::StrCat("cannot write ", beside.string()));
  Call call(SceneOf(request.model()), 0);
  const auto stream = connection.segmentation->ExportSelection(call, request);
  absl::StatusOr<Header> header = Receive(*stream, part);
  std::error_code error;
  if (!header.ok()) {
    static_cast<grpc::ClientContext*>(call)->TryCancel();
    fs::remove(beside, error);
    return header.status();
  }
  fs::rename(beside, file, error);
  if (error) {
    return absl::PermissionDeniedError(absl::StrCat("cannot write ", file, ": ", error.message()));
  }
  return header;
}

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

}  // namespace pepeseg::cli
