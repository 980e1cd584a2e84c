#include "tests/testing/fake_sam.h"

#include <fstream>

#include "core/base/digest.h"

namespace pepeseg::testing {

namespace fs = std::filesystem;

namespace {

constexpr const char* kNames[] = {"encoder.onnx", "sam.onnx", "detector.onnx", "words.txt",
                                  "libonnxruntime.so.1"};

void WriteDigests(const fs::path& folder) {
  std::ofstream list(folder / "SHA256SUMS");
  for (const char* name : kNames) {
    if (!fs::exists(folder / name)) continue;
    list << Sha256OfFile(folder / name).value_or("") << "  " << name << "\n";
  }
}

}  // namespace

std::string ProtoBytes(int number, const std::string& content) {
  std::string bytes(1, static_cast<char>(number << 3 | 2));
  size_t size = content.size();
  for (; size >= 128; size >>= 7) bytes.push_back(static_cast<char>(size | 128));
  bytes.push_back(static_cast<char>(size));
  return bytes + content;
}

std::string FakeDecoder() {
  std::string node;
  for (const char* input : {"image_embeddings", "point_coords", "point_labels"}) {
    node += ProtoBytes(1, input);
  }
  for (const char* output :
       {"/Reshape_9_output_0", "/iou_prediction_head/layers.2/Gemm_output_0"}) {
    node += ProtoBytes(2, output);
  }
  return ProtoBytes(7, ProtoBytes(1, node));
}

void MakeFakeSam(const fs::path& folder) {
  fs::create_directories(folder);
  fs::copy_file(PEPESEG_FAKE_ONNX_RUNTIME, folder / "libonnxruntime.so.1");
  std::ofstream(folder / "encoder.onnx", std::ios::binary) << "an encoder";
  std::ofstream(folder / "sam.onnx", std::ios::binary) << FakeDecoder();
  WriteDigests(folder);
}

void MakeFakeDetector(const fs::path& folder, const std::string& words) {
  fs::create_directories(folder);
  fs::copy_file(PEPESEG_FAKE_ONNX_RUNTIME, folder / "libonnxruntime.so.1");
  std::ofstream(folder / "detector.onnx", std::ios::binary) << "a detector";
  std::ofstream(folder / "words.txt") << words;
  WriteDigests(folder);
}

fs::path MakeLpips(const fs::path& folder, const fs::path& runtime) {
  const fs::path library =
      runtime.empty() ? fs::path(PEPESEG_FAKE_ONNX_RUNTIME) : runtime / "libonnxruntime.so.1";
  fs::create_directories(folder);
  fs::copy_file(library, folder / "libonnxruntime.so.1", fs::copy_options::overwrite_existing);
  fs::copy_file(PEPESEG_TEST_DATA "/lpips/tiny.onnx", folder / "lpips.onnx",
                fs::copy_options::overwrite_existing);
  return folder / "lpips.onnx";
}

void ReplaceSamFile(const fs::path& folder, const std::string& name, const std::string& bytes) {
  fs::remove(folder / name);
  std::ofstream(folder / name, std::ios::binary) << bytes;
  WriteDigests(folder);
}

}  // namespace pepeseg::testing
