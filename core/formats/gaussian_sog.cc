#include "core/formats/gaussian_sog.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "core/base/status_macros.h"
#include "core/formats/codebook.h"
#include "core/formats/encode_webp.h"
#include "core/formats/zip_writer.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using Json = nlohmann::ordered_json;

// Entries of the palette in a row of its image.
constexpr size_t kEntriesInRow = 64;
constexpr size_t kMaxEntries = 65536;

// A file that is in memory.
class WholeFile final : public GaussianBlocks {
 public:
  WholeFile(const Gaussians& gaussians, std::vector<uint32_t> indices, std::string bytes)
      : GaussianBlocks(gaussians, std::move(indices)), bytes_(std::move(bytes)) {}

  int64_t num_blocks() const override {
    return (static_cast<int64_t>(bytes_.size()) + kMaxBlockBytes - 1) / kMaxBlockBytes;
  }
  std::string Encode(int64_t block) const override {
    return bytes_.substr(static_cast<size_t>(block * kMaxBlockBytes), kMaxBlockBytes);
  }

 private:
  std::string bytes_;
};

// RGBA, opaque and black at first.
struct Texture {
  const char* name;
  int width = 0, height = 0;
  std::vector<uint8_t> pixels;

  Texture(const char* name, int width, int height)
      : name(name),
        width(width),
        height(height),
        pixels(size_t{4} * static_cast<size_t>(width) * static_cast<size_t>(height), 0) {
    for (size_t i = 3; i < pixels.size(); i += 4) pixels[i] = 255;
  }
  void Set(size_t pixel, int channel, uint8_t value) {
    pixels[4 * pixel + static_cast<size_t>(channel)] = value;
  }
};

uint8_t ByteOf(float value) {
  return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0f, 255.0f)));
}

// Makes coordinates that are far from the origin coarser than those near to it.
float LogOf(float coordinate) {
  return std::copysign(std::log1p(std::abs(coordinate)), coordinate);
}

// Returns the 21 lowest bits of a number, each with two zeros above it.
uint64_t Spread(uint64_t bits) {
  bits &= 0x1fffff;
  bits = (bits | bits << 32) & 0x1f00000000ffff;
  bits = (bits | bits << 16) & 0x1f0000ff0000ff;
  bits = (bits | bits << 8) & 0x100f00f00f00f00f;
  bits = (bits | bits << 4) & 0x10c30c30c30c30c3;
  return (bits | bits << 2) & 0x1249249249249249;
}

struct Range {
  float min = 0, max = 0;

  // Returns the place of a value within the range, 0 to `most`.
  uint32_t Quantized(float value, uint32_t most) const {
    if (!(max > min)) return 0;
    const double part = (double{value} - min) / (double{max} - min);
    return static_cast<uint32_t>(std::lround(std::clamp(part, 0.0, 1.0) * most));
  }
};

// Encodes the Gaussians at `rows` of a model.
class SogEncoder {
 public:
  SogEncoder(const Gaussians& gaussians, const std::vector<uint32_t>& indices, ThreadPool& pool,
             absl::FunctionRef<absl::Status()> check)
      : gaussians_(gaussians), pool_(pool), check_(check), rows_(indices) {
    const auto count = static_cast<int>(rows_.size());
    // Multiples of 4, as the format's own writer has them; one at least, as images are not empty.
    width_ = std::max(4, static_cast<int>(std::ceil(std::sqrt(count) / 4)) * 4);
    height_ = std::max(4, (count + 4 * width_ - 1) / (4 * width_) * 4);
  }

  absl::StatusOr<std::string> Encode() {
    FindRanges();
    Sort();
    RETURN_IF_ERROR(check_());
    Json meta = {{"version", 2},
                 {"asset", {{"generator", "pepeseg"}}},
                 {"count", rows_.size()},
                 {"antialias", false},
                 {"means", AddMeans()},
                 {"scales", AddScales()},
                 {"quats", AddRotations()},
                 {"sh0", AddColors()}};
    RETURN_IF_ERROR(check_());
    if (gaussians_.sh_degree > 0 && !rows_.empty()) meta["shN"] = AddSh();
    RETURN_IF_ERROR(check_());
    std::vector<std::string> images(textures_.size());
    pool_.ParallelFor(static_cast<int64_t>(textures_.size()), [&](int64_t i, int) {
      const Texture& texture = textures_[static_cast<size_t>(i)];
      images[static_cast<size_t>(i)] =
          EncodeLosslessWebp(texture.pixels, texture.width, texture.height);
    });
    RETURN_IF_ERROR(check_());
    ZipWriter zip;
    RETURN_IF_ERROR(zip.Add("meta.json", meta.dump(), ZipWriter::Method::kDeflated));
    for (size_t i = 0; i < images.size(); ++i) {
      RETURN_IF_ERROR(zip.Add(textures_[i].name, images[i], ZipWriter::Method::kStored));
    }
    return std::move(zip).Finish();
  }

 private:
  float ValueOf(int plane, size_t row) const { return gaussians_.Plane(plane)[rows_[row]]; }

  // Adds a texture with a pixel for each Gaussian.
  Texture& Add(const char* name) { return textures_.emplace_back(name, width_, height_); }

  // Calls body(row) for each row, in parallel.
  template <class Body>
  void ForRows(const Body& body) {
    constexpr size_t kRowsPerTask = 16384;
    const size_t num_tasks = (rows_.size() + kRowsPerTask - 1) / kRowsPerTask;
    pool_.ParallelFor(static_cast<int64_t>(num_tasks), [&](int64_t task, int) {
      const size_t first = static_cast<size_t>(task) * kRowsPerTask;
      const size_t end = std::min(first + kRowsPerTask, rows_.size());
      for (size_t row = first; row < end; ++row) body(row);
    });
  }

  void FindRanges() {
    for (int k = 0; k < 3; ++k) {
      Range& range = ranges_[k];
      for (size_t row = 0; row < rows_.size(); ++row) {
        const float value = LogOf(ValueOf(kMeanPlane + k, row));
        range.min = row == 0 ? value : std::min(range.min, value);
        range.max = row == 0 ? value : std::max(range.max, value);
      }
    }
  }

  // Sorts the rows by the Morton code of their positions, so that neighbours in space are
  // neighbours in the images, which makes these smaller.
  void Sort() {
    std::vector<std::pair<uint64_t, uint32_t>> keys(rows_.size());
    ForRows([&](size_t row) {
      uint64_t code = 0;
      for (int k = 0; k < 3; ++k) {
        const float value = LogOf(ValueOf(kMeanPlane + k, row));
        code |= Spread(ranges_[k].Quantized(value, (1u << 21) - 1)) << k;
      }
      keys[row] = {code, rows_[row]};
    });
    std::ranges::sort(keys);
    for (size_t row = 0; row < rows_.size(); ++row) rows_[row] = keys[row].second;
  }

  Json AddMeans() {
    Texture low("means_l.webp", width_, height_), high("means_u.webp", width_, height_);
    ForRows([&](size_t row) {
      for (int k = 0; k < 3; ++k) {
        const uint32_t value = ranges_[k].Quantized(LogOf(ValueOf(kMeanPlane + k, row)), 65535);
        low.Set(row, k, static_cast<uint8_t>(value));
        high.Set(row, k, static_cast<uint8_t>(value >> 8));
      }
    });
    textures_.push_back(std::move(low));
    textures_.push_back(std::move(high));
    return {{"mins", {ranges_[0].min, ranges_[1].min, ranges_[2].min}},
            {"maxs", {ranges_[0].max, ranges_[1].max, ranges_[2].max}},
            {"files", {"means_l.webp", "means_u.webp"}}};
  }

  // Sets three channels to the codes of three planes, and returns the codebook.
  Codebook SetCodes(int first_plane, Texture& texture) {
    std::vector<float> values(3 * rows_.size());
    ForRows([&](size_t row) {
      for (int k = 0; k < 3; ++k) {
        values[3 * row + static_cast<size_t>(k)] = ValueOf(first_plane + k, row);
      }
    });
    const Codebook codebook = MakeCodebook(std::move(values));
    ForRows([&](size_t row) {
      for (int k = 0; k < 3; ++k) {
        texture.Set(row, k, NearestCode(codebook, ValueOf(first_plane + k, row)));
      }
    });
    return codebook;
  }

  Json AddScales() {
    Texture& texture = Add("scales.webp");
    const Codebook codebook = SetCodes(kLogScalePlane, texture);
    return {{"codebook", codebook}, {"files", {texture.name}}};
  }

  Json AddColors() {
    Texture& texture = Add("sh0.webp");
    const Codebook codebook = SetCodes(kShPlane, texture);
    ForRows([&](size_t row) {
      texture.Set(row, 3, ByteOf(255 / (1 + std::exp(-ValueOf(kOpacityPlane, row)))));
    });
    return {{"codebook", codebook}, {"files", {texture.name}}};
  }

  // The alpha of a rotation says which of w, x, y and z is the largest; the others follow in order.
  Json AddRotations() {
    Texture& texture = Add("quats.webp");
    for (size_t i = 3; i < texture.pixels.size(); i += 4) texture.pixels[i] = 252;
    ForRows([&](size_t row) {
      std::array<float, 4> rotation;
      double squares = 0;
      size_t largest = 0;
      for (size_t k = 0; k < 4; ++k) {
        rotation[k] = ValueOf(kRotationPlane + static_cast<int>(k), row);
        squares += double{rotation[k]} * rotation[k];
        if (std::abs(rotation[k]) > std::abs(rotation[largest])) largest = k;
      }
      const double unit = (rotation[largest] < 0 ? -1 : 1) * std::sqrt(2 / squares);
      int channel = 0;
      for (size_t k = 0; k < 4; ++k) {
        if (k == largest) continue;
        const auto part = static_cast<float>(rotation[k] * unit);  // -1 to 1
        texture.Set(row, channel++, ByteOf(127.5f * (part + 1)));
      }
      texture.Set(row, 3, static_cast<uint8_t>(252 + largest));
    });
    return {{"files", {texture.name}}};
  }

  Json AddSh() {
    // Those of degree 0 are in sh0.
    const auto num_coefficients = static_cast<size_t>(NumShCoefficients(gaussians_.sh_degree)) - 1;
    const size_t num_dimensions = 3 * num_coefficients;
    std::vector<float> vectors(rows_.size() * num_dimensions);
    ForRows([&](size_t row) {
      for (size_t k = 0; k < num_dimensions; ++k) {
        vectors[row * num_dimensions + k] = ValueOf(kShPlane + 3 + static_cast<int>(k), row);
      }
    });
    // As many entries for few Gaussians as these, for many one for 16 of them.
    constexpr size_t kFew = 1024, kShare = 16;
    const size_t max_entries =
        std::min(kMaxEntries, std::max(std::min(rows_.size(), kFew), rows_.size() / kShare));
    const Palette palette = MakePalette(vectors, num_dimensions, max_entries, pool_);
    const Codebook codebook = MakeCodebook(palette.entries);

    const size_t num_rows = (palette.num_entries() + kEntriesInRow - 1) / kEntriesInRow;
    Texture centroids("shN_centroids.webp", static_cast<int>(kEntriesInRow * num_coefficients),
                      static_cast<int>(num_rows));
    // A row of the image has its entries' coefficients one after the other, without a gap.
    for (size_t i = 0; i < palette.entries.size(); ++i) {
      centroids.Set(i / 3, static_cast<int>(i % 3), NearestCode(codebook, palette.entries[i]));
    }
    textures_.push_back(std::move(centroids));
    Texture& labels = Add("shN_labels.webp");
    ForRows([&](size_t row) {
      labels.Set(row, 0, static_cast<uint8_t>(palette.labels[row]));
      labels.Set(row, 1, static_cast<uint8_t>(palette.labels[row] >> 8));
    });
    return {{"count", palette.num_entries()},
            {"bands", gaussians_.sh_degree},
            {"codebook", codebook},
            {"files", {"shN_centroids.webp", "shN_labels.webp"}}};
  }

  const Gaussians& gaussians_;
  ThreadPool& pool_;
  const absl::FunctionRef<absl::Status()> check_;
  std::vector<uint32_t> rows_;  // the Gaussian of each pixel
  int width_ = 0, height_ = 0;
  std::array<Range, 3> ranges_;  // of the logs of positions
  std::vector<Texture> textures_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<const GaussianBlocks>> MakeGaussianSog(
    const Gaussians& gaussians, std::vector<uint32_t> indices, ThreadPool& pool,
    absl::FunctionRef<absl::Status()> check) {
  assert(static_cast<int64_t>(indices.size()) <= kMaxSogGaussians);
  SogEncoder encoder(gaussians, indices, pool, check);
  ASSIGN_OR_RETURN(std::string bytes, encoder.Encode());
  return std::make_unique<WholeFile>(gaussians, std::move(indices), std::move(bytes));
}

int64_t BytesOfSog(int64_t count, int sh_degree) {
  // The orders, the textures, and values of a codebook with the sums before them.
  constexpr int64_t kBytes = 4 + 4 + 16 + 7 * 4 + 3 * 12;
  // libwebp takes several times the pixels of each image that it encodes.
  constexpr int64_t kImageBytes = 7 * 40;
  const int64_t num_dimensions = 3 * (NumShCoefficients(sh_degree) - 1);
  // A Gaussian's coefficients, its part of the palette with the codebook's values, and its place.
  const int64_t sh_bytes = num_dimensions * 4 + num_dimensions * (4 + 12) / 16 + 32;
  constexpr int64_t kFixed = int64_t{32} << 20;  // what little takes, too, as the palette of a few
  return kFixed + count * (kBytes + std::max(kImageBytes, sh_bytes));
}

}  // namespace pepeseg
