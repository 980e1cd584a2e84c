// Writes what pepeseg_sam_encoder_bench compares with: embeddings by ONNX Runtime.
//   pepeseg_sam_references SAM_FOLDER OUT PHOTO...
// Photograph k becomes OUT/k.rgb, two 32-bit integers for width and height and then its pixels, and
// OUT/k.half, its embedding as Halves, [places, channels].

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/formats/images.h"
#include "core/priors/sam/sam_networks.h"
#include "kernels/half.h"

namespace pepeseg {
namespace {

absl::Status WriteReference(const SamNetworks& networks, const std::filesystem::path& photo_file,
                            const std::string& out) {
  const auto photo = DecodePhoto(photo_file, photo_file.string());
  if (!photo.ok()) return photo.status();
  const auto embedding = EmbedPhotograph(*networks.encoder, *photo);
  if (!embedding.ok()) return embedding.status();
  std::ofstream rgb(out + ".rgb", std::ios::binary);
  const int32_t size[2] = {photo->width, photo->height};
  rgb.write(reinterpret_cast<const char*>(size), sizeof(size));
  rgb.write(reinterpret_cast<const char*>(photo->pixels.data()),
            static_cast<int64_t>(photo->pixels.size()));
  constexpr int kChannels = 256, kPlaces = 64 * 64;
  std::ofstream halves(out + ".half", std::ios::binary);
  for (int i = 0; i < kChannels * kPlaces; ++i) {
    const Half half = HalfFromFloat(embedding->values[i % kChannels * kPlaces + i / kChannels]);
    halves.write(reinterpret_cast<const char*>(&half), sizeof(half));
  }
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  if (argc < 4) {
    std::printf("usage: %s SAM_FOLDER OUT PHOTO...\n", argv[0]);
    return 2;
  }
  // The decoder's graph stays as it is, less what its masks do not need.
  const OnnxGraphEdit edit = {{},
                              {{"image_embeddings", {1, 256, 64, 64}},
                               {"point_coords", {1, -1, 2}},
                               {"point_labels", {1, -1}},
                               {"mask_input", {1, 1, 256, 256}},
                               {"has_mask_input", {1}}},
                              {{kSamMasks, {-1, 4, 256, 256}}, {kSamIous, {-1, 4}}}};
  const auto networks = SamNetworks::Open(argv[1], edit, {.num_threads = 2});
  absl::Status status = networks.status();
  for (int k = 3; k < argc && status.ok(); ++k) {
    const auto out = std::filesystem::path(argv[2]) / std::to_string(k - 3);
    status = WriteReference(**networks, argv[k], out.string());
  }
  if (!status.ok()) std::printf("%s\n", status.ToString().c_str());
  return status.ok() ? 0 : 1;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) { return pepeseg::Main(argc, argv); }
