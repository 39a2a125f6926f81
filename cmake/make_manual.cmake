# The manual page of a program, made by help2man of its --help and --version. Its line in `whatis` is the first sentence of
# the help.
# usage: cmake -DPROGRAM=... -DHELP2MAN=... -DGZIP=... -DINCLUDE=... -DOUTPUT=FILE.1 -P make_manual.cmake; writes FILE.1.gz
cmake_minimum_required(VERSION 3.18)
execute_process(COMMAND ${PROGRAM} --help OUTPUT_VARIABLE help RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "${PROGRAM} --help: ${failed}")
endif()
string(REGEX MATCH "^[^.:]+" summary "${help}")
string(REGEX REPLACE "[ \n]+" " " summary "${summary}")
string(SUBSTRING "${summary}" 0 1 first)
string(SUBSTRING "${summary}" 1 -1 rest)
string(TOLOWER "${first}" first)
foreach(command IN ITEMS
        "${HELP2MAN};--no-info;--section=1;--name=${first}${rest};--include=${INCLUDE};--output=${OUTPUT};${PROGRAM}"
        "${GZIP};-9nf;${OUTPUT}")
  execute_process(COMMAND ${command} RESULT_VARIABLE failed ERROR_VARIABLE words)
  if(failed)
    message(FATAL_ERROR "${command}\n${words}")
  endif()
endforeach()
