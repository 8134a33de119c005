# pointwright_add_kernels(<target> <source.inc>): compiles a kernel source once per instruction set, each time into its
# own namespace (engine/core/simd.h says how to write one, engine/core/simd_dispatch.h how to call it). On processors
# other than x86-64 there is only the baseline variant.
function(pointwright_add_kernels target source)
  get_filename_component(absolute ${source} ABSOLUTE)
  get_filename_component(stem ${source} NAME_WE)
  file(RELATIVE_PATH include_path ${PROJECT_SOURCE_DIR} ${absolute})

  set(options_simd_base "")
  set(variants simd_base)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    # The features that engine/core/simd_dispatch.cpp asks the processor for; deliberately without fused operations.
    set(options_simd_v3 -mavx2)
    set(options_simd_v4 -mavx2 -mavx512f -mavx512vl -mavx512bw -mavx512dq -mavx512cd -mprefer-vector-width=512)
    list(APPEND variants simd_v3 simd_v4)
  endif()
  foreach(variant ${variants})
    set(unit ${CMAKE_CURRENT_BINARY_DIR}/kernels/${stem}_${variant}.cpp)
    file(CONFIGURE OUTPUT ${unit} CONTENT
      "#define POINTWRIGHT_SIMD_NAMESPACE ${variant}\n#include \"${include_path}\"\n" @ONLY)
    # -Wno-psabi: vectors are never passed between translation units. A source's options follow its target's, so
    # they win over the baseline.
    set_source_files_properties(${unit} TARGET_DIRECTORY ${target} PROPERTIES
      SKIP_PRECOMPILE_HEADERS ON COMPILE_OPTIONS "-Wno-psabi;${options_${variant}}")
    target_sources(${target} PRIVATE ${unit})
  endforeach()
endfunction()
