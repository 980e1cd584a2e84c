#pragma once

#include <filesystem>
#include <string>

namespace pepeseg::testing {

// Makes a folder like deploy/sam.sh's, with fake_onnx_runtime.cc as its library.
void MakeFakeSam(const std::filesystem::path& folder);

// Makes a folder like deploy/detector.sh's, with the same library and these words. The detector
// finds the red pixels, with the score 0.8, and the blue ones, with 0.4.
void MakeFakeDetector(const std::filesystem::path& folder,
                      const std::string& words = "apple\nball\n");

// Puts the network of tests/data/lpips into a folder, next to a library: that of the folder
// `runtime`, or fake_onnx_runtime.cc if it is empty. Returns the network's path.
std::filesystem::path MakeLpips(const std::filesystem::path& folder,
                                const std::filesystem::path& runtime = {});

// Replaces a file in a folder of either kind, and its digest in SHA256SUMS.
void ReplaceSamFile(const std::filesystem::path& folder, const std::string& name,
                    const std::string& bytes);

// Returns a length-delimited field of a protobuf message.
std::string ProtoBytes(int number, const std::string& content);

// Returns the smallest ONNX model with the inputs and outputs of SAM's decoder.
std::string FakeDecoder();

}  // namespace pepeseg::testing
