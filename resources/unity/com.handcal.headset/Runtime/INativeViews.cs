using System.Collections.Generic;
using Handcal.Link;

namespace Handcal
{
    /// <summary>
    /// Draws with the calibration below Unity, in every render pipeline and mode: the package's part
    /// for Unity's OpenXR plug-in. Without it the component sets the camera's matrices.
    /// </summary>
    public interface INativeViews
    {
        /// <summary>Draws with a state's calibration from the next frame on; null: with the runtime's own views.</summary>
        void Calibrate(HeadsetState state);

        /// <summary>The runtime's own views of both eyes, without their sizes; empty until they are known.</summary>
        List<View> Own();

        /// <summary>The reason why the calibration is not drawn with; empty if there is none.</summary>
        string Refusal { get; }
    }
}
