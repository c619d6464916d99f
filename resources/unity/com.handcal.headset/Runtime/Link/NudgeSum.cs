using System;

namespace Handcal.Link
{
    /// <summary>The movement of a drawing by the wearer since its verification began.</summary>
    public struct NudgeSum
    {
        const double MaxArcmin = 300.0, MaxSize = 0.3;
        public double RightArcmin, DownArcmin;

        /// <summary>Growth of the drawing: 0.01 is one per cent larger.</summary>
        public double Size;

        /// <summary>The sum after some presses; it ends at what the PC takes.</summary>
        public NudgeSum Plus(Verify steps, int right, int down, int larger)
        {
            return new NudgeSum
            {
                RightArcmin = Limit(RightArcmin + right * steps.StepArcmin, MaxArcmin),
                DownArcmin = Limit(DownArcmin + down * steps.StepArcmin, MaxArcmin),
                Size = Limit(Size + larger * steps.StepSize, MaxSize),
            };
        }

        static double Limit(double value, double most)
        {
            return Math.Max(-most, Math.Min(most, value));
        }
    }
}
