@echo off
rem Makes handcal's environment beside this file: Python 3.13 (of this PC, or fetched by uv) and
rem the packages of the folder wheels, by their hashes, without a network. Open3D, if it was chosen,
rem is fetched unless it is there too. Exit code 3: all but Open3D was installed.
setlocal
cd /d "%~dp0"
set UV_PYTHON_INSTALL_DIR=%~dp0python
set UV_PYTHON_INSTALL_BIN=0
set UV_PYTHON_INSTALL_REGISTRY=0
set UV_NO_CACHE=1
set UV_NO_CONFIG=1
uv.exe venv --clear --python 3.13 env || exit /b 1
uv.exe pip install --python env\Scripts\python.exe --offline --no-index --find-links wheels ^
  --require-hashes -r requirements.txt || exit /b 1
for %%w in (wheels\handcal-*.whl) do (
  uv.exe pip install --python env\Scripts\python.exe --offline --no-index --no-deps "%%w" || exit /b 1
)
set from=
if exist wheels\open3d-*.whl set from=--offline --no-index --find-links wheels
if exist requirements-open3d.txt (
  uv.exe pip install --python env\Scripts\python.exe %from% --no-deps --require-hashes ^
    -r requirements-open3d.txt || exit /b 3
)
rmdir /s /q wheels
