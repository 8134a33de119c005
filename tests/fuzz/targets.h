#pragma once
// One function per fuzzing target: takes any bytes, throws or stops on a broken promise. The libFuzzer
// programs call one each; the corpus replay test calls them all.

#include <cstddef>
#include <span>

namespace pointwright::fuzz {

void try_draco_tiles(
    std::span<const std::byte> bytes);             ///< the archive, its index, and each tile as try_draco
void try_draco(std::span<const std::byte> bytes);  ///< the gate, then the decoder behind it, then finishing
void try_ply(std::span<const std::byte> bytes);    ///< reader, finishing, and writer and reader again
void try_xyz(std::span<const std::byte> bytes);    ///< the same
void try_obj(std::span<const std::byte> bytes);    ///< the same
void try_pcd(std::span<const std::byte> bytes);    ///< the same, decompression included
void try_las(std::span<const std::byte> bytes);    ///< the same, and the writer of LAS
void try_cloud_blob(std::span<const std::byte> bytes);  ///< the daemon's side of the confined decoder
void try_png(std::span<const std::byte> bytes);         ///< the gate, then the decoder behind it
void try_frame(std::span<const std::byte> bytes);       ///< the decoder of sample frames
void try_stream(std::span<const std::byte> bytes);      ///< records of a stream, cut anywhere
void try_json(std::span<const std::byte> bytes);        ///< the text, then every request's parser
void try_head(std::span<const std::byte> bytes);        ///< a request's head, then what reads its fields
void try_answer(std::span<const std::byte> bytes);      ///< what a decoder that went mad may say
void try_marks(std::span<const std::byte> bytes);       ///< marks as they are stored

}  // namespace pointwright::fuzz
