#pragma once

#include <filesystem>
#include <string>

namespace pepeseg::testing {

// Makes a folder as deploy/sam.sh does, whose library is fake_onnx_runtime.cc.
void MakeFakeSam(const std::filesystem::path& folder);

// Replaces a file of such a folder, and its digest in SHA256SUMS.
void ReplaceSamFile(const std::filesystem::path& folder, const std::string& name,
                    const std::string& bytes);

// A field of a protobuf message.
std::string ProtoBytes(int number, const std::string& content);

// The smallest ONNX model with what is expected of SAM's decoder.
std::string FakeDecoder();

}  // namespace pepeseg::testing
